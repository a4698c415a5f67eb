-- Is an object grasped at the same part every time: how far do features overlap, within and between subjects?
--
-- Parameters:
--   object text = null  only the object of this name
--
-- Columns:
--   object        name of the object
--   pairs         within: two grasps of one subject; between: of two subjects
--   n_pairs       pairs of grasps with a feature
--   mean_overlap  mean overlap of their features: points of both over points of either, 0 to 1
--   sd_overlap    standard deviation of the overlap
--   disjoint      share of the pairs that have no point in common
--   half_shared   share of the pairs with an overlap of at least one half
--   best_overlap  mean, over the grasps, of the largest overlap with another grasp of such a pair
--
-- Fu and Santello (2011) call the features of their subjects highly consistent and give no figure; this is
-- one: who grasps an object in several ways, as theirs did, has a low mean and yet a high best overlap where
-- others choose the same ways. Grasps are compared where their objects have the same cloud, also across sessions. A subject is
-- a name. The time taken grows with the square of the grasps of an object.

WITH chosen AS (
    SELECT row_number() OVER () AS i, o.object, o.cloud, o.subject, list_distinct(f.points) AS points
    FROM features f
    JOIN grasp_objects o USING (grasp)
    WHERE len(f.points) > 0
      AND ($object IS NULL OR o.object = $object)
),
points AS (
    SELECT i, object, cloud, unnest(points) AS point
    FROM chosen
),
shared AS (
    SELECT a.i AS i, b.i AS j, count(*) AS n_shared
    FROM points a
    JOIN points b ON b.object = a.object AND b.cloud = a.cloud AND b.point = a.point AND a.i <> b.i
    GROUP BY a.i, b.i
),
pairs AS (
    SELECT
        a.object,
        a.i,
        CASE WHEN a.subject = b.subject THEN 'within' ELSE 'between' END AS pairs,
        coalesce(n_shared, 0) / (len(a.points) + len(b.points) - coalesce(n_shared, 0)) AS overlap
    FROM chosen a
    JOIN chosen b ON b.object = a.object AND b.cloud = a.cloud AND a.i <> b.i
    LEFT JOIN shared s ON s.i = a.i AND s.j = b.i
),
best AS (
    SELECT object, pairs, avg(overlap) AS best_overlap
    FROM (SELECT object, pairs, i, max(overlap) AS overlap FROM pairs GROUP BY object, pairs, i)
    GROUP BY object, pairs
)
SELECT
    object,
    pairs,
    -- Every pair stands there in both orders.
    count(*) // 2 AS n_pairs,
    avg(overlap) AS mean_overlap,
    sqrt(var_pop(overlap) * n_pairs / nullif(n_pairs - 1, 0)) AS sd_overlap,
    avg((overlap = 0)::INT) AS disjoint,
    avg((overlap >= 0.5)::INT) AS half_shared,
    any_value(best_overlap) AS best_overlap
FROM pairs
JOIN best USING (object, pairs)
GROUP BY object, pairs
ORDER BY object, pairs DESC
