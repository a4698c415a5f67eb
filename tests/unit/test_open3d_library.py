"""Where Open3D cannot be loaded, the message names the package to install."""

import importlib
import re
from types import ModuleType

import pytest

from graspdb_ingest.objects.open3d_library import DEBIAN_PACKAGES, load_open3d
from graspdb_schemas.errors import MissingLibraryError


def failing_import(monkeypatch: pytest.MonkeyPatch, message: str) -> None:
    def fail(name: str) -> ModuleType:
        raise ImportError(message, name=name)

    monkeypatch.setattr(importlib, "import_module", fail)


@pytest.mark.parametrize(("library", "package"), DEBIAN_PACKAGES.items())
def test_a_missing_system_library_names_its_package(
    monkeypatch: pytest.MonkeyPatch, library: str, package: str
) -> None:
    failing_import(monkeypatch, f"{library}: cannot open shared object file: No such file or directory")
    with pytest.raises(MissingLibraryError, match=re.escape(f"apt-get install {package} ")):
        load_open3d()


def test_an_unknown_system_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    failing_import(monkeypatch, "libstrange.so.7: cannot open shared object file: No such file or directory")
    with pytest.raises(MissingLibraryError, match=r"holds libstrange\.so\.7"):
        load_open3d()


def test_a_missing_package_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    failing_import(monkeypatch, "No module named 'open3d'")
    with pytest.raises(MissingLibraryError, match="pip install open3d"):
        load_open3d()
