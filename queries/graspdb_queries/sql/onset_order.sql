-- In which order do the digits come to touch the object?
--
-- Parameters:
--   object  text = null  only the object of this name
--   subject text = null  only this subject
--
-- Columns:
--   object      name of the object
--   digit       name of the digit
--   n_grasps    grasps in which the digit is in contact at the snapshot
--   first       share of these in which no digit was earlier
--   mean_rank   mean place in the order of onset, from 1; digits that come together share the better place
--   mean_delay  mean time from the first contact of the grasp to the digit's [s]
--   sd_delay    standard deviation of that time [s]
--
-- A digit's onset is that of its first contact in the grasp. Left out are digits that have let go again by the
-- snapshot, and grasps of which a digit's onset was not seen, for their order is not known.

WITH contacts_of AS (
    SELECT grasp, digit, arg_min(onset_time, first_time) AS onset, bool_or(onset_time IS NULL) AS unseen
    FROM contact_events
    GROUP BY grasp, digit
),
onsets AS (
    SELECT grasp, g.object, digit, onset, bool_or(unseen) OVER (PARTITION BY grasp) AS unknown
    FROM grasps g
    JOIN contacts_of USING (grasp)
    WHERE list_contains(g.digits, digit)
      AND ($object IS NULL OR g.object = $object)
      AND ($subject IS NULL OR g.subject = $subject)
),
ranked AS (
    SELECT
        object,
        digit,
        rank() OVER (PARTITION BY grasp ORDER BY onset) AS place,
        onset - min(onset) OVER (PARTITION BY grasp) AS delay
    FROM onsets
    WHERE NOT unknown
)
SELECT
    object,
    digit,
    count(*) AS n_grasps,
    avg((place = 1)::INT) AS first,
    avg(place) AS mean_rank,
    avg(delay) AS mean_delay,
    stddev_samp(delay) AS sd_delay
FROM ranked
GROUP BY object, digit
ORDER BY object, mean_rank, digit_index(digit)
