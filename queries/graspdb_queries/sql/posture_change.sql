-- How does the posture change from first contact to lift?
--
-- Parameters:
--   object  text = null  only the object of this name
--   subject text = null  only this subject
--
-- Columns:
--   joint       name of the joint angle
--   n_grasps    grasps that end in a lift
--   at_contact  mean angle at first contact [rad]
--   at_lift     mean angle at the onset of lift [rad]
--   change      mean of the second minus the first: positive is more flexion, or abduction [rad]
--   sd_change   standard deviation of the change [rad]
--
-- Example: object=mug
--
-- Angles of left and right hands mean the same, so both are counted together.

WITH chosen AS (
    SELECT grasp, trial, side, onset_time, lift_time
    FROM grasps
    WHERE lift_time IS NOT NULL
      AND ($object IS NULL OR object = $object)
      AND ($subject IS NULL OR subject = $subject)
),
contact AS (
    SELECT g.grasp, joint_angles(f.q) AS angles
    FROM chosen g
    ASOF JOIN frames f ON f.trial = g.trial AND f.side = g.side AND f.time <= g.onset_time + 1e-6
),
lift AS (
    SELECT g.grasp, joint_angles(f.q) AS angles
    FROM chosen g
    ASOF JOIN frames f ON f.trial = g.trial AND f.side = g.side AND f.time <= g.lift_time + 1e-6
),
angles AS (
    SELECT unnest(range(1, 24)) AS i, unnest(contact.angles) AS at_contact, unnest(lift.angles) AS at_lift
    FROM contact
    JOIN lift USING (grasp)
    WHERE contact.angles IS NOT NULL AND lift.angles IS NOT NULL
)
SELECT
    joint_names()[i] AS joint,
    count(*) AS n_grasps,
    avg(at_contact) AS at_contact,
    avg(at_lift) AS at_lift,
    avg(at_lift - at_contact) AS change,
    stddev_samp(at_lift - at_contact) AS sd_change
FROM angles
WHERE isfinite(at_contact) AND isfinite(at_lift)
GROUP BY i
ORDER BY i
