-- Where is an object grasped: how often is each of its points touched, covered by the hand, and enclosed?
--
-- Parameters:
--   object  text = null    only the object of this name
--   subject text = null    only grasps of this subject
--   radius  number = 0.01  how far from a point a contact may be to count for it [m]
--
-- Columns:
--   object           name of the object
--   cloud            its cloud, as in grasp_objects
--   point            index of the point in the cloud
--   x                position in the object frame [m]
--   y                position in the object frame [m]
--   z                position in the object frame [m]
--   n_grasps         grasps of the object
--   touched          share of the grasps with a contact within the radius
--   contact_density  contacts within the radius, for each grasp and area of the disc of this radius [1/m2]
--   covered          share of the grasps in which the hand's surface is nearer than the threshold of contact
--   enclosed         share of the grasps whose feature has the point
--
-- Example: object=mug radius=0.015
--
-- Points that no grasp touches, covers or encloses have zeros, so the rows are the whole object, ready to be coloured.

WITH chosen AS (
    SELECT grasp, o.object, o.cloud, o.object_ingest_id, g.contact_threshold
    FROM grasp_objects o
    JOIN grasps g USING (grasp)
    WHERE ($object IS NULL OR o.object = $object)
      AND ($subject IS NULL OR o.subject = $subject)
),
clouds AS (
    SELECT object, cloud, count(*) AS n_grasps, min(object_ingest_id) AS ingest_id
    FROM chosen
    GROUP BY object, cloud
),
points AS (
    SELECT c.object, c.cloud, c.n_grasps, p.point, p.position::DOUBLE[] AS position
    FROM clouds c
    JOIN object_points p USING (object, ingest_id)
),
cells AS (
    SELECT object, cloud, point, position, [floor(p / $radius)::BIGINT for p in position] AS cell
    FROM points
),
-- A contact is near a point only if their cells of this size are neighbours.
offsets AS (
    SELECT i.i AS i, j.i AS j, k.i AS k
    FROM range(-1, 2) i(i), range(-1, 2) j(i), range(-1, 2) k(i)
),
contact_cells AS (
    SELECT
        grasp, object, cloud, position,
        [floor(position[1] / $radius)::BIGINT + i, floor(position[2] / $radius)::BIGINT + j,
         floor(position[3] / $radius)::BIGINT + k] AS cell
    FROM contacts
    JOIN chosen USING (grasp), offsets
    WHERE norm(position) IS NOT NULL
),
touched AS (
    SELECT object, cloud, point, count(DISTINCT grasp) AS n_touched, count(*) AS n_contacts
    FROM cells p
    JOIN contact_cells c USING (object, cloud, cell)
    WHERE distance(p.position, c.position) <= $radius
    GROUP BY object, cloud, point
),
covered AS (
    SELECT object, cloud, point, count(*) AS n_covered
    FROM (
        SELECT c.object, c.cloud, c.contact_threshold, unnest(points) AS point, unnest(gaps) AS gap
        FROM contact_maps m
        JOIN chosen c USING (grasp)
    )
    WHERE gap <= contact_threshold
    GROUP BY object, cloud, point
),
enclosed AS (
    SELECT object, cloud, point, count(*) AS n_enclosed
    FROM (
        SELECT c.object, cloud, unnest(list_distinct(points)) AS point
        FROM features f
        JOIN chosen c USING (grasp)
    )
    GROUP BY object, cloud, point
)
SELECT
    object,
    cloud,
    point,
    position[1] AS x,
    position[2] AS y,
    position[3] AS z,
    n_grasps,
    coalesce(n_touched, 0) / n_grasps AS touched,
    coalesce(n_contacts, 0) / n_grasps / (pi() * $radius ** 2) AS contact_density,
    coalesce(n_covered, 0) / n_grasps AS covered,
    coalesce(n_enclosed, 0) / n_grasps AS enclosed
FROM points
LEFT JOIN touched USING (object, cloud, point)
LEFT JOIN covered USING (object, cloud, point)
LEFT JOIN enclosed USING (object, cloud, point)
ORDER BY object, cloud, point
