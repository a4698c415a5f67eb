"""Similarity of grasps: by graspable feature, posture and contact."""
