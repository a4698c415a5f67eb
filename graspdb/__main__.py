"""``python -m graspdb`` is ``graspdb``."""

from graspdb.cli import main

main()
