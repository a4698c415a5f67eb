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
-- A digit's onset is the first frame between the first contact of the hold and the snapshot in which one of
-- its sites is nearer than the threshold of contact. Digits that have let go again by the snapshot are left out.

WITH onsets AS (
    SELECT g.grasp, g.object, d.digit, min(f.time) AS onset
    FROM grasps g
    JOIN frames f
        ON f.trial = g.trial AND f.side = g.side AND f.time BETWEEN g.onset_time - 1e-6 AND g.snapshot_time + 1e-6
    CROSS JOIN unnest(g.digits) d(digit)
    WHERE digit_gap(f.gap, d.digit) < g.contact_threshold
      AND ($object IS NULL OR g.object = $object)
      AND ($subject IS NULL OR g.subject = $subject)
    GROUP BY g.grasp, g.object, d.digit
),
ranked AS (
    SELECT
        object,
        digit,
        rank() OVER (PARTITION BY grasp ORDER BY onset) AS place,
        onset - min(onset) OVER (PARTITION BY grasp) AS delay
    FROM onsets
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
