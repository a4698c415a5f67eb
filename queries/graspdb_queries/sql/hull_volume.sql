-- How large is the space that the hand encloses, by kind of grasp?
--
-- Parameters:
--   object  text = null  only the object of this name
--   subject text = null  only this subject
--
-- Columns:
--   grasp_type       type of the GRASP taxonomy; null where the contacts do not tell it
--   digits           digits in contact at the snapshot, thumb first, joined by +
--   n_grasps         grasps of this kind: this type, with these digits
--   hull_volume      mean volume of the enclosing space: the convex hull of the touching spheres [m3]
--   hull_sd          its standard deviation [m3]
--   box_ratio        mean volume of the least bounding box over that of the hull
--   ellipsoid_ratio  the same of the least ellipsoid
--   sphere_ratio     the same of the least sphere
--   feature_area     mean area of the feature inside the hull [m2]
--
-- Fu and Santello (2011) tried box, ellipsoid and sphere too and kept the hull as the most compact: the ratios
-- say by how much. Grasps without a hull are left out. Feix and others (2016) arrange the types; pad, palm and
-- side opposition enclose very different spaces with the same digits, and one type may use more digits or fewer.

SELECT
    grasp_type,
    digit_pattern(digits) AS digits,
    count(*) AS n_grasps,
    avg(hull_volume) AS hull_volume,
    stddev_samp(hull_volume) AS hull_sd,
    avg(box_volume / hull_volume) AS box_ratio,
    avg(ellipsoid_volume / hull_volume) AS ellipsoid_ratio,
    avg(sphere_volume / hull_volume) AS sphere_ratio,
    avg(feature_area) AS feature_area
FROM grasps
WHERE hull_volume > 0
  AND ($object IS NULL OR object = $object)
  AND ($subject IS NULL OR subject = $subject)
GROUP BY ALL
ORDER BY n_grasps DESC, grasp_type, digits
