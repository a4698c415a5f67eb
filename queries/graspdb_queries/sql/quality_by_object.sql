-- How good are the grasps of each object, by each quality index?
--
-- Parameters:
--   object  text = null  only the object of this name
--   subject text = null  only this subject
--
-- Columns:
--   object    name of the object
--   index     name of the index; force_closure is 1 or 0, so its mean is the share of grasps that have it
--   n_grasps  grasps that have it
--   mean      mean of the index
--   sd        its standard deviation
--   least     least value
--   median    median
--   greatest  greatest value

WITH indices AS (
    SELECT
        object,
        unnest(
            list_append(
                coalesce(map_entries(quality), []),
                {key: 'force_closure', value: force_closure::INT::DOUBLE}
            )
        ) AS entry
    FROM grasps
    WHERE ($object IS NULL OR object = $object)
      AND ($subject IS NULL OR subject = $subject)
)
SELECT
    object,
    entry.key AS index,
    count(*) AS n_grasps,
    avg(entry.value) AS mean,
    stddev_samp(entry.value) AS sd,
    min(entry.value) AS least,
    median(entry.value) AS median,
    max(entry.value) AS greatest
FROM indices
WHERE isfinite(entry.value)
GROUP BY object, index
ORDER BY index, mean DESC, object
