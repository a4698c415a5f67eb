-- How wide is the hand opened for what it grasps, before first contact and in the grasp?
--
-- Parameters:
--   object  text = null   only the object of this name
--   subject text = null   only this subject
--   window  number = 1.0  how long before first contact the peak is looked for [s]
--
-- Columns:
--   grasp          the grasp
--   subject        name of the subject
--   object         name of the object
--   size           what the hand is closed on: from the mean contact point of the thumb to that of the fingers [m]
--   aperture       distance of thumb tip to index tip at the snapshot [m]
--   peak_aperture  greatest distance of these tips before first contact [m]
--   peak_lead      how long before first contact that was [s]
--
-- The peak is looked for after the last release before this grasp. Size is null where thumb or fingers do
-- not touch, the peak where the trial begins in contact.

WITH chosen AS (
    SELECT
        *,
        max(release_time) OVER (
            PARTITION BY trial, side ORDER BY onset_time, grasp ROWS BETWEEN UNBOUNDED PRECEDING AND 1 PRECEDING
        ) AS last_release
    FROM grasps
),
sizes AS (
    SELECT
        grasp,
        distance(
            [avg(x) FILTER (thumb), avg(y) FILTER (thumb), avg(z) FILTER (thumb)],
            [avg(x) FILTER (NOT thumb), avg(y) FILTER (NOT thumb), avg(z) FILTER (NOT thumb)]
        ) AS size
    FROM (
        SELECT grasp, digit = 'thumb' AS thumb, position[1] AS x, position[2] AS y, position[3] AS z
        FROM contacts
    )
    GROUP BY grasp
),
apertures AS (
    SELECT
        g.grasp,
        g.onset_time - f.time AS lead,
        distance(site_position(f.sites, 'thumb_tip'), site_position(f.sites, 'index_tip')) AS aperture
    FROM chosen g
    JOIN frames f ON f.trial = g.trial AND f.side = g.side
    WHERE f.time < g.onset_time
      AND f.time >= g.onset_time - $window
      AND f.time > coalesce(g.last_release, '-infinity'::DOUBLE)
),
peaks AS (
    SELECT grasp, max(aperture) AS peak_aperture, arg_max(lead, aperture) AS peak_lead
    FROM apertures
    GROUP BY grasp
)
SELECT
    grasp,
    subject,
    object,
    size,
    grip_aperture AS aperture,
    peak_aperture,
    peak_lead
FROM chosen
LEFT JOIN sizes USING (grasp)
LEFT JOIN peaks USING (grasp)
WHERE ($object IS NULL OR object = $object)
  AND ($subject IS NULL OR subject = $subject)
ORDER BY grasp
