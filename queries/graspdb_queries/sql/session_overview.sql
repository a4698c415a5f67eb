-- How good are the recordings of each session and subject: occlusion, residual, trials rejected?
--
-- Parameters:
--   session text = null    only this session
--
-- Columns:
--   session           identifier of the session
--   subject           name of the subject
--   n_trials          trials, rejected ones included
--   n_rejected        trials rejected
--   n_grasps          grasps found
--   duration          length of all trials together [s]
--   missing_fraction  share of hand-marker positions not seen, over all frames
--   residual_rms      rms distance of hand markers to the tracked hand, over all frames [m]
--   worst_trial       trial with the largest residual, the first of several
--   worst_residual    its residual [m]

SELECT
    session,
    subject,
    count(*) AS n_trials,
    count(*) FILTER (status = 'rejected') AS n_rejected,
    coalesce(sum(n_grasps), 0)::BIGINT AS n_grasps,
    sum(duration) AS duration,
    sum(missing_fraction * n_frames) / sum(n_frames) FILTER (missing_fraction IS NOT NULL) AS missing_fraction,
    sqrt(sum(residual_rms ** 2 * n_frames) / sum(n_frames) FILTER (residual_rms IS NOT NULL)) AS residual_rms,
    first(trial ORDER BY residual_rms DESC, trial) FILTER (residual_rms IS NOT NULL) AS worst_trial,
    max(residual_rms) AS worst_residual
FROM trials
WHERE $session IS NULL OR session = $session
GROUP BY session, subject
ORDER BY session, subject
