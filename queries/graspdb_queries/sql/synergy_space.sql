-- Where do grasps lie in the space of their postural synergies?
--
-- Parameters:
--   components    integer = 3                         components that span the space
--   normalisation covariance|correlation = covariance  angles as they are; or each over its standard deviation
--   joints        digits|all|santello1998 = digits   21 angles of the digits; all 23; or 15 as in that study
--   object        text = null                        only the object of this name
--   subject       text = null                        only this subject
--
-- Columns:
--   grasp     the grasp
--   subject   name of the subject
--   object    name of the object
--   score_1   score on the first component [rad; without unit for correlation]
--   score_2   score on the second
--   scores    scores on all components of the space
--   residual  root mean square, over the angles, of what the space leaves of the posture [rad]
--
-- Example: components=2
--
-- Computed by: synergies.space
--
-- The components are those of the query synergies for the same grasps. Grasps in which an angle is missing are
-- left out.

SELECT grasp, subject, object, joint_angles(q) AS angles
FROM grasps
WHERE ($object IS NULL OR object = $object)
  AND ($subject IS NULL OR subject = $subject)
ORDER BY grasp
