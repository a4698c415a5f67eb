"""The set-up script, with an interpreter, apt-get and sudo that only note what they were asked."""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "tools" / "setup.sh"
SYSTEM_TOOLS = ("bash", "cat", "dirname", "env", "mkdir", "ln", "sha256sum")

PYTHON = """#!/usr/bin/env bash
case "$*" in
    --version) echo "Python $VERSION" ;;
    "-c import sys; sys.exit"*) [ "$VERSION" != 3.10.4 ] ;;
    "- "*) cat >/dev/null; for name in $MISSING; do echo "$name"; done ;;
    "-m venv --clear "*) mkdir -p "$4/bin"; ln -sf "$0" "$4/bin/python" ;;
    "-c import open3d") [ -z "${OPEN3D_FAILS:-}" ] ;;
    *) [ -z "$*" ] || echo "python $*" >>"$LOG" ;;
esac
"""
NOTES_ITSELF = '#!/usr/bin/env bash\necho "${0##*/} $*" >>"$LOG"\n'


@dataclass(frozen=True)
class Machine:
    """A folder with the script in a project of its own, and the only programs it can find."""

    root: Path

    def put(self, name: str, text: str) -> None:
        """Add a program."""
        path = self.root / "bin" / name
        path.write_text(text)
        path.chmod(0o755)

    def user(self, number: int) -> None:
        """Say who runs the script; 0 is root."""
        self.put("id", f"#!/usr/bin/env bash\necho {number}\n")

    def setup(self, version: str = "3.12.1", **environment: str) -> subprocess.CompletedProcess[str]:
        """Run the script with an interpreter of that version."""
        variables = {"PATH": str(self.root / "bin"), "LOG": str(self.root / "log"), "VERSION": version}
        return subprocess.run(
            [str(self.root / "tools" / "setup.sh")],
            env=variables | environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )

    @property
    def log(self) -> list[str]:
        """Return what the programs were asked."""
        path = self.root / "log"
        return path.read_text().splitlines() if path.exists() else []


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """Make a machine with Python and apt-get, where an ordinary user without sudo is at work."""
    for folder in ("bin", "tools"):
        (tmp_path / folder).mkdir()
    shutil.copy(SCRIPT, tmp_path / "tools" / "setup.sh")
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    (tmp_path / "constraints.txt").write_text("numpy==2.4.6\n")
    for tool in SYSTEM_TOOLS:
        (tmp_path / "bin" / tool).symlink_to(str(shutil.which(tool)))
    result = Machine(tmp_path)
    result.put("python3", PYTHON)
    result.put("apt-get", NOTES_ITSELF)
    result.put("chromium", NOTES_ITSELF)
    result.user(1000)
    return result


def test_makes_the_environment_once(machine: Machine) -> None:
    first = machine.setup()
    assert first.returncode == 0, first.stderr
    assert "making .venv with Python 3.12.1" in first.stdout
    installs = [line for line in machine.log if " -m pip install " in f" {line}"]
    assert all("--constraint constraints.txt" in line for line in installs)
    assert installs[-1].endswith("--no-build-isolation --editable .[test,bench]")
    asked = len(machine.log)

    assert machine.setup().stdout == ""
    assert not [line for line in machine.log[asked:] if "pip" in line]

    (machine.root / "constraints.txt").write_text("numpy==2.4.7\n")
    assert "making .venv" in machine.setup().stdout


def test_nothing_is_installed_where_no_package_is_missing(machine: Machine) -> None:
    machine.user(0)
    assert machine.setup().returncode == 0
    assert not [line for line in machine.log if line.startswith("apt-get")]


def test_an_interpreter_too_old_is_named(machine: Machine) -> None:
    done = machine.setup(version="3.10.4")
    assert done.returncode == 1
    assert "needs Python 3.11 or newer; found: Python 3.10.4" in done.stderr
    assert not (machine.root / ".venv").exists()


def test_a_newer_interpreter_is_found_beside_an_old_one(machine: Machine) -> None:
    machine.put("python3.12", PYTHON.replace("$VERSION", "3.12.9"))
    assert "with Python 3.12.9" in machine.setup(version="3.10.4").stdout


def test_without_root_the_packages_are_named_and_nothing_is_done(machine: Machine) -> None:
    done = machine.setup(MISSING="libusb-1.0.so.0 libGL.so.1 python3.12-venv")
    assert done.returncode == 1
    assert "apt-get install libusb-1.0-0 libgl1 python3.12-venv" in done.stderr
    assert not machine.log
    assert not (machine.root / ".venv").exists()


def test_without_apt_get_the_packages_are_named(machine: Machine) -> None:
    (machine.root / "bin" / "apt-get").unlink()
    machine.user(0)
    done = machine.setup(MISSING="libusb-1.0.so.0")
    assert done.returncode == 1
    assert "libusb-1.0-0" in done.stderr


def test_root_installs_what_is_missing_and_goes_on(machine: Machine) -> None:
    machine.user(0)
    done = machine.setup(MISSING="libEGL.so.1 libX11.so.6")
    assert done.returncode == 0, done.stderr
    update, install = [line for line in machine.log if line.startswith("apt-get")]
    assert update.endswith(" update")
    assert install.endswith(" install -y --no-install-recommends libegl1 libx11-6")
    assert (machine.root / ".venv" / "bin" / "python").exists()


def test_root_installs_a_browser_where_there_is_none(machine: Machine) -> None:
    (machine.root / "bin" / "chromium").unlink()
    machine.user(0)
    assert machine.setup().returncode == 0
    assert [line for line in machine.log if line.startswith("apt-get") and line.endswith(" chromium")]


def test_without_a_browser_and_root_it_says_which_tests_will_fail(machine: Machine) -> None:
    (machine.root / "bin" / "chromium").unlink()
    done = machine.setup()
    assert done.returncode == 0
    assert "apt-get install chromium" in done.stderr
    assert "tests/browser will fail" in done.stderr
    assert (machine.root / ".venv" / "bin" / "python").exists()


def test_sudo_without_a_password_installs_too(machine: Machine) -> None:
    machine.put("sudo", NOTES_ITSELF + 'shift\n[ "$1" = true ] || exec "$@"\n')
    assert machine.setup(MISSING="libidn2.so.0").returncode == 0
    assert [line for line in machine.log if line.startswith("apt-get") and line.endswith(" libidn2-0")]


def test_sudo_that_asks_for_a_password_is_left_alone(machine: Machine) -> None:
    machine.put("sudo", "#!/usr/bin/env bash\nexit 1\n")
    done = machine.setup(MISSING="libudev.so.1")
    assert done.returncode == 1
    assert "apt-get install libudev1" in done.stderr
    assert not machine.log


def test_an_open3d_that_does_not_load_stops_and_is_tried_again(machine: Machine) -> None:
    assert machine.setup(OPEN3D_FAILS="yes").returncode == 1
    assert "Open3D cannot be loaded" in machine.setup(OPEN3D_FAILS="yes").stderr
    assert machine.setup().returncode == 0
