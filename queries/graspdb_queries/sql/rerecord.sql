-- Which trials should be recorded again, and why?
--
-- Parameters:
--   session      text = null     only this session
--   max_missing  number = 0.25   share of hand-marker positions that may be missing
--   max_residual number = 0.005  rms distance of hand markers to the tracked hand that is put up with [m]
--
-- Columns:
--   session           identifier of the session
--   trial             the trial
--   subject           name of the subject
--   object            name of the object
--   task              task that the manifest gives
--   repetition        repetition that the manifest gives
--   why               what is wrong with it, the reasons of a rejection first
--   missing_fraction  share of hand-marker positions not seen
--   residual_rms      rms distance of hand markers to the tracked hand [m]
--
-- Example: max_missing=0.2
--
-- A trial with an object and without a grasp is listed too, since nothing in it can be compared.

WITH judged AS (
    SELECT
        *,
        list_concat(
            CASE WHEN status = 'rejected' THEN coalesce(nullif(reasons, []), ['rejected']) ELSE [] END,
            list_filter(
                [
                    CASE WHEN missing_fraction > $max_missing
                        THEN format('{:.0f} % of the hand markers missing', 100 * missing_fraction) END,
                    CASE WHEN residual_rms > $max_residual
                        THEN format('residual of {:.1f} mm', to_mm(residual_rms)) END,
                    CASE WHEN status = 'ok' AND object IS NOT NULL AND n_grasps = 0 THEN 'no grasp found' END
                ],
                lambda said: said IS NOT NULL
            )
        ) AS why
    FROM trials
    WHERE $session IS NULL OR session = $session
)
SELECT session, trial, subject, object, task, repetition, why, missing_fraction, residual_rms
FROM judged
WHERE len(why) > 0
ORDER BY session, subject, object, task, repetition, trial
