-- Which grasps are made with given digits?
--
-- Parameters:
--   digits  text                       digits joined by +, such as thumb+index
--   match   exactly|at_least|at_most = exactly  whether other digits may touch too, or some of these not
--   object  text = null                only the object of this name
--   subject text = null                only this subject
--
-- Columns:
--   grasp          the grasp
--   subject        name of the subject
--   object         name of the object
--   side           right or left
--   digits         digits in contact at the snapshot, thumb first, joined by +
--   contact_sites  sites in contact
--   hull_volume    volume of the enclosing space [m3]
--
-- Example: digits=thumb+index match=at_least

WITH chosen AS (
    SELECT *, digits_of_pattern($digits) AS asked
    FROM grasps
    WHERE ($object IS NULL OR object = $object)
      AND ($subject IS NULL OR subject = $subject)
)
SELECT grasp, subject, object, side, digit_pattern(digits) AS digits, contact_sites, hull_volume
FROM chosen
WHERE ($match = 'at_most' OR list_has_all(chosen.digits, asked))
  AND ($match = 'at_least' OR list_has_all(asked, chosen.digits))
ORDER BY grasp
