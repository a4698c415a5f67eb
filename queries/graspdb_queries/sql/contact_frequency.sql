-- How often does each site of the hand touch each object?
--
-- Parameters:
--   object  text = null    only the object of this name
--   subject text = null    only this subject
--
-- Columns:
--   object      name of the object
--   site        site of the hand
--   digit       digit of that site
--   n_grasps    grasps of the object
--   n_contacts  grasps in which the site touches
--   frequency   share of the grasps in which the site touches
--
-- Example: object=mug
--
-- Sites that never touch an object are left out.

WITH chosen AS (
    SELECT grasp, object
    FROM grasps
    WHERE ($object IS NULL OR object = $object)
      AND ($subject IS NULL OR subject = $subject)
),
per_object AS (
    SELECT object, count(*) AS n_grasps
    FROM chosen
    GROUP BY object
)
SELECT
    object,
    site,
    any_value(digit) AS digit,
    any_value(n_grasps) AS n_grasps,
    count(*) AS n_contacts,
    count(*) / any_value(n_grasps) AS frequency
FROM contacts
JOIN chosen USING (grasp)
JOIN per_object USING (object)
GROUP BY object, site
ORDER BY object, frequency DESC, site
