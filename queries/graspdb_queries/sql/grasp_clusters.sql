-- Which groups of like posture do grasps fall into?
--
-- Parameters:
--   clusters      integer = 5                         number of groups
--   linkage       ward|average|complete = ward        how groups are joined, from single grasps upwards
--   normalisation covariance|correlation = covariance  angles as they are; or each over its standard deviation
--   joints        digits|all|santello1998 = digits   21 angles of the digits; all 23; or 15 as in that study
--   object        text = null                        only the object of this name
--   subject       text = null                        only this subject
--
-- Columns:
--   grasp     the grasp
--   subject   name of the subject
--   object    name of the object
--   cluster   number of its group, from 1; the largest comes first
--   n_grasps  grasps in the group
--   distance  root mean square difference of its joint angles from the group's mean [rad]
--   central   whether it is nearest to that mean: the grasp to show for the group
--
-- Example: clusters=2
--
-- Computed by: synergies.clusters
--
-- Agglomerative clustering of the joint angles: the same grasps give the same groups. Grasps in which an
-- angle is missing are left out.

SELECT grasp, subject, object, joint_angles(q) AS angles
FROM grasps
WHERE ($object IS NULL OR object = $object)
  AND ($subject IS NULL OR subject = $subject)
ORDER BY grasp
