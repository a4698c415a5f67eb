-- Which digits does each subject grasp each object with?
--
-- Parameters:
--   object  text = null    only the object of this name
--   subject text = null    only this subject
--
-- Columns:
--   object    name of the object
--   subject   name of the subject
--   digits    digits in contact at the snapshot, thumb first, joined by +
--   n_digits  number of these digits
--   n_grasps  grasps with exactly these digits
--   share     share of the subject's grasps of the object

WITH patterns AS (
    SELECT object, subject, array_to_string(digits, '+') AS digits, len(digits) AS n_digits
    FROM grasps
    WHERE ($object IS NULL OR object = $object)
      AND ($subject IS NULL OR subject = $subject)
)
SELECT
    object,
    subject,
    digits,
    any_value(n_digits) AS n_digits,
    count(*) AS n_grasps,
    count(*) / sum(count(*)) OVER (PARTITION BY object, subject) AS share
FROM patterns
GROUP BY object, subject, digits
ORDER BY object, subject, n_grasps DESC, digits
