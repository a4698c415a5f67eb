-- How far is each digit's estimated contact from its measured centre of pressure?
--
-- Parameters:
--   object  text = null    only the object of this name
--   subject text = null    only this subject
--
-- Columns:
--   grasp          the grasp
--   subject        name of the subject
--   object         name of the object
--   pair           the digits whose pressure was measured, thumb first, joined by +
--   digit          digit that pressed
--   n_points       sites of the digit in contact at the snapshot
--   measured       measured centre of pressure nearest in time to the snapshot, object frame (3) [m]
--   error          distance of the mean of the digit's contact points to it [m]; null without any
--   weighted_error  distance of their mean weighted by the square of how far each gap is below h [m]
--   distal_error   distance of the contact point of the digit's most distal touching site to it [m]
--
-- For trials with reference_contacts; a pressure counts if it was measured within 20 ms of the snapshot.

WITH pressed AS (
    SELECT
        g.grasp,
        any_value(g.subject) AS subject,
        any_value(g.object) AS object,
        r.digit,
        arg_min(r.position, abs(r.time - g.snapshot_time)) AS measured
    FROM grasps AS g
    JOIN reference_contacts AS r ON r.trial = g.trial AND abs(r.time - g.snapshot_time) <= 0.02
    WHERE ($object IS NULL OR g.object = $object)
      AND ($subject IS NULL OR g.subject = $subject)
    GROUP BY g.grasp, r.digit
),
estimated AS (
    SELECT
        grasp,
        digit,
        count(*) AS n_points,
        [avg(position[1]), avg(position[2]), avg(position[3])] AS middle,
        [
            sum(position[1] * depth ** 2) / sum(depth ** 2),
            sum(position[2] * depth ** 2) / sum(depth ** 2),
            sum(position[3] * depth ** 2) / sum(depth ** 2)
        ] AS pressed_middle,
        arg_max(
            position,
            list_position(['cmc', 'mcp', 'pip', 'dip', 'ip', 'tip'], split_part(site, '_', 2))
        ) AS distal
    FROM (
        SELECT contacts.*, greatest(contact_threshold - contacts.gap, 1e-6) AS depth
        FROM contacts
        JOIN grasps USING (grasp)
    )
    GROUP BY grasp, digit
)
SELECT
    grasp,
    subject,
    object,
    string_agg(digit, '+') OVER (PARTITION BY grasp ORDER BY place
        ROWS BETWEEN UNBOUNDED PRECEDING AND UNBOUNDED FOLLOWING) AS pair,
    digit,
    coalesce(n_points, 0) AS n_points,
    measured,
    list_distance(middle, measured) AS error,
    list_distance(pressed_middle, measured) AS weighted_error,
    list_distance(distal, measured) AS distal_error
FROM (
    SELECT *, list_position(['thumb', 'index', 'middle', 'ring', 'little'], digit) AS place
    FROM pressed
    LEFT JOIN estimated USING (grasp, digit)
)
ORDER BY subject, pair, grasp, place
