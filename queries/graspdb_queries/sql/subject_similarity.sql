-- How alike do subjects grasp: features, sites and postures of their grasps of the same objects?
--
-- Parameters:
--   object text = null  only the object of this name
--
-- Columns:
--   subject        name of a subject
--   other          name of another, or the same: how alike the subject's own grasps are
--   n_objects      objects that both grasped
--   n_pairs        pairs of grasps, one of each, of the same object
--   features       mean overlap of their features: points of both over points of either, 0 to 1
--   sites          mean overlap of the sites in contact, 0 to 1
--   posture        root mean square difference of their joint angles, the wrist's left out [rad]
--
-- Objects weigh the same, however many pairs they have. Every pair of subjects stands in both orders, so
-- that the rows are a matrix. Features count where the objects have the same cloud. The time taken grows with
-- the square of the grasps of an object.

WITH chosen AS (
    SELECT
        row_number() OVER () AS i,
        g.object,
        g.subject,
        o.cloud,
        g.contact_sites,
        CASE WHEN isfinite(list_sum(joint_angles(g.q))) THEN joint_angles(g.q)[3:23] END AS angles,
        list_distinct(f.points) AS points
    FROM grasps g
    LEFT JOIN grasp_objects o USING (grasp)
    LEFT JOIN features f USING (grasp)
    WHERE g.subject IS NOT NULL
      AND ($object IS NULL OR g.object = $object)
),
points AS (
    SELECT i, object, cloud, unnest(points) AS point
    FROM chosen
),
shared AS (
    SELECT a.i AS i, b.i AS j, count(*) AS n_shared
    FROM points a
    JOIN points b ON b.object = a.object AND b.cloud = a.cloud AND b.point = a.point AND a.i < b.i
    GROUP BY a.i, b.i
),
pairs AS (
    SELECT
        least(a.subject, b.subject) AS subject,
        greatest(a.subject, b.subject) AS other,
        a.object AS object,
        CASE WHEN a.cloud = b.cloud AND len(a.points) > 0 AND len(b.points) > 0
            THEN coalesce(n_shared, 0) / (len(a.points) + len(b.points) - coalesce(n_shared, 0)) END AS features,
        overlap(a.contact_sites, b.contact_sites) AS sites,
        list_avg([(angle[1] - angle[2]) ** 2 for angle in list_zip(a.angles, b.angles)]) AS square
    FROM chosen a
    JOIN chosen b ON b.object = a.object AND a.i < b.i
    LEFT JOIN shared s ON s.i = a.i AND s.j = b.i
),
by_object AS (
    SELECT
        subject,
        other,
        object,
        count(*) AS n_pairs,
        avg(features) AS features,
        avg(sites) AS sites,
        avg(square) AS square
    FROM pairs
    GROUP BY subject, other, object
),
alike AS (
    SELECT
        subject,
        other,
        count(*) AS n_objects,
        sum(n_pairs)::BIGINT AS n_pairs,
        avg(features) AS features,
        avg(sites) AS sites,
        sqrt(avg(square)) AS posture
    FROM by_object
    GROUP BY subject, other
)
FROM alike
UNION ALL
SELECT other, subject, * EXCLUDE (subject, other)
FROM alike
WHERE subject <> other
ORDER BY subject, other
