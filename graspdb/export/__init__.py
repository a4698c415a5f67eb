"""Export: what a query selects, written for trainers and for other tools.

`selection` asks the database which grasps; `reading` turns them into `Episode` and `Grasp` dataclasses, a
part at a time; a `Writer` of `formats` turns parts into files; `run` drives it, and adds card and checksums.
"""
