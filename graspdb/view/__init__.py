"""Grasps to look at: the scene of a grasp as data, its page, its pictures."""
