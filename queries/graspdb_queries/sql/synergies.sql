-- Which postural synergies do grasps have: the principal components of the joint angles, and what they explain?
--
-- Parameters:
--   postures      grasps|movements = grasps          one posture a grasp, at the snapshot; or every tracked frame
--   normalisation covariance|correlation = covariance  angles as they are; or each over its standard deviation
--   joints        digits|all|santello1998 = digits   21 angles of the digits; all 23; or 15 as in that study
--   object        text = null                        only the object of this name
--   subject       text = null                        only this subject
--
-- Columns:
--   component   number of the component, from 1
--   variance    variance along it [rad2; without unit for correlation]
--   explained   share of the variance of all angles together
--   cumulative  share that it and those before it explain together
--   n_postures  postures that went in
--   loadings    its part of each joint angle: a unit vector, by name of the angle
--
-- Example: postures=grasps normalisation=covariance
--
-- Computed by: synergies.components
--
-- How many components are many depends on the protocol. Santello, Flanders and Soechting (1998): two components,
-- over 80 % of the variance, of 15 joint angles in static postures of five people who imagined grasping and using
-- 57 objects. Jarque-Bou and others (2019): twelve, over 80 %, of whole movements of 77 people who did up to
-- 20 grasps of daily life in a data glove. Static postures (postures=grasps, joints=santello1998)
-- have a figure of the first kind, postures=movements one of the second; and correlation, which lets
-- small movements count as much as large ones, needs more components than covariance. State all three with a
-- figure. Angles of left and right hands mean the same and go in together. Postures in which an angle
-- is missing, and components without variance, are left out.

SELECT joint_angles(q) AS angles
FROM grasps
WHERE $postures = 'grasps'
  AND ($object IS NULL OR object = $object)
  AND ($subject IS NULL OR subject = $subject)
UNION ALL
SELECT joint_angles(f.q) AS angles
FROM frames f
JOIN trials t USING (trial)
WHERE $postures = 'movements'
  AND NOT coalesce(list_contains(f.flags, 'not_tracked'), false)
  AND ($object IS NULL OR t.object = $object)
  AND ($subject IS NULL OR t.subject = $subject)
