"""Kept machine code: when it is used again, and when it is not."""

import subprocess
import sys

from graspdb_ingest.compiled import source_stamp

PROGRAM = """
from graspdb_ingest.compiled import compiled, is_kept

@compiled
def one_more(x):
    return x + 1

print(is_kept(one_more), one_more(1))
"""


def stamp(folder):
    source_stamp.cache_clear()
    return source_stamp(folder)


def test_machine_code_is_out_of_date_once_any_compiled_module_changes(tmp_path):
    (tmp_path / "deep").mkdir()
    called, caller = tmp_path / "deep" / "called.py", tmp_path / "caller.py"
    called.write_text("@compiled\ndef one(): return 1\n")
    caller.write_text("@compiled\ndef two(): return one()\n")
    before = stamp(tmp_path)
    assert stamp(tmp_path) == before
    called.write_text("@compiled\ndef one(): return 3\n")
    assert stamp(tmp_path) != before


def test_other_modules_do_not_count(tmp_path):
    (tmp_path / "kept.py").write_text("@compiled\ndef one(): return 1\n")
    before = stamp(tmp_path)
    (tmp_path / "other.py").write_text("def plain(): return 1\n")
    assert stamp(tmp_path) == before


def test_machine_code_is_kept_for_the_next_process(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    runs = [subprocess.run([sys.executable, tmp_path / "program.py"], capture_output=True) for _ in range(2)]
    assert [run.stdout.split() for run in runs] == [[b"False", b"2"], [b"True", b"2"]]
