<<<<<<< HEAD
"""The commands, one module each."""
=======
"""The commands of the command line, one module each; they import what is heavy only when they run."""
>>>>>>> readers
