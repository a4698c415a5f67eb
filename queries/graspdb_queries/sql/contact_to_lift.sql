-- How long do subjects take from first contact to lift?
--
-- Parameters:
--   object  text = null  only the object of this name
--   subject text = null  only this subject
--
-- Columns:
--   object    name of the object
--   subject   name of the subject
--   n_grasps  grasps that end in a lift
--   mean      mean time from first contact to the onset of lift [s]
--   sd        its standard deviation [s]
--   least     least time [s]
--   median    median time [s]
--   greatest  greatest time [s]

WITH times AS (
    SELECT object, subject, lift_time - onset_time AS time
    FROM grasps
    WHERE ($object IS NULL OR object = $object)
      AND ($subject IS NULL OR subject = $subject)
)
SELECT
    object,
    subject,
    count(*) AS n_grasps,
    avg(time) AS mean,
    stddev_samp(time) AS sd,
    min(time) AS least,
    median(time) AS median,
    max(time) AS greatest
FROM times
WHERE time IS NOT NULL
GROUP BY object, subject
ORDER BY object, subject
