"""The commands of ``graspdb``, one module each; what is heavy is imported inside them."""
