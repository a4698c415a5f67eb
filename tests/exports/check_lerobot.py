"""Read a lerobot export with the package lerobot: every frame, its statistics, and ten training steps of ACT.

Runs in an environment of its own: python tests/exports/check_lerobot.py FOLDER
"""

import os
import sys
from importlib.metadata import version
from pathlib import Path

os.environ["HF_HUB_OFFLINE"] = "1"

import numpy as np
import pyarrow.parquet as pq
import torch
from lerobot.configs.types import FeatureType
from lerobot.datasets.compute_stats import aggregate_stats, compute_episode_stats
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.utils import dataset_to_policy_features
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors

STEPS = 10
CHUNK = 16


def check_frames(dataset: LeRobotDataset, root: Path) -> dict[str, np.ndarray]:
    """Return all columns, having checked that every frame comes as it stands in the files."""
    paths = sorted((root / "data").glob("*/*.parquet"))
    tables = [pq.read_table(path) for path in paths]
    columns = {
        name: np.concatenate([np.array(table[name].to_pylist()) for table in tables])
        for name in dataset.features
    }
    tasks = pq.read_table(root / "meta" / "tasks.parquet").to_pandas().index
    assert len(dataset) == len(columns["index"])
    for i in range(len(dataset)):
        frame = dataset[i]
        for name, values in columns.items():
            np.testing.assert_array_equal(frame[name].numpy(), values[i].astype(frame[name].numpy().dtype))
        assert frame["task"] == tasks[columns["task_index"][i]]
    return columns


def check_statistics(dataset: LeRobotDataset, columns: dict[str, np.ndarray]) -> float:
    """Check statistics against those that lerobot computes of the same frames.

    lerobot takes quantiles from histograms of 5000 bins; the largest difference is returned, as a share of
    the feature's range.
    """
    episodes = columns["episode_index"]
    each = [
        compute_episode_stats(
            {name: values[episodes == episode] for name, values in columns.items()}, dataset.features
        )
        for episode in np.unique(episodes)
    ]
    theirs, largest = aggregate_stats(each), 0.0
    for name, statistics in theirs.items():
        width = np.maximum(statistics["max"] - statistics["min"], 1e-9)
        for statistic, numbers in statistics.items():
            ours = dataset.meta.stats[name][statistic]
            assert ours.shape == numbers.shape, (name, statistic)
            if statistic.startswith("q"):
                largest = max(largest, float(np.max(np.abs(ours - numbers) / width)))
            else:
                # Theirs are sums of float32.
                np.testing.assert_allclose(ours, numbers, rtol=1e-4, atol=3e-4 * float(width.max()))
    return largest


def train(root: Path, dataset: LeRobotDataset) -> list[float]:
    """Return the losses of some training steps of ACT on states alone."""
    torch.manual_seed(0)
    features = dataset_to_policy_features(dataset.features)
    outputs = {name: one for name, one in features.items() if one.type is FeatureType.ACTION}
    inputs = {name: one for name, one in features.items() if name not in outputs}
    config = ACTConfig(
        input_features=inputs,
        output_features=outputs,
        chunk_size=CHUNK,
        n_action_steps=CHUNK,
        dim_model=64,
        dim_feedforward=128,
        device="cpu",
    )
    policy = ACTPolicy(config)
    prepare, _ = make_pre_post_processors(config, dataset_stats=dataset.meta.stats)
    times = {"action": [i / dataset.fps for i in config.action_delta_indices]}
    windows = LeRobotDataset("graspdb/export", root=root, delta_timestamps=times)
    loader = torch.utils.data.DataLoader(windows, batch_size=32, shuffle=True)
    optimizer = torch.optim.AdamW(policy.parameters(), lr=1e-3)
    losses = []
    for batch, _ in zip(loader, range(STEPS), strict=False):
        loss, _parts = policy.forward(prepare(batch))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    return losses


def main() -> None:
    """Check a folder and say what was found."""
    root = Path(sys.argv[1])
    dataset = LeRobotDataset("graspdb/export", root=root)
    columns = check_frames(dataset, root)
    off = check_statistics(dataset, columns)
    losses = train(root, dataset)
    assert np.isfinite(losses).all()
    assert losses[-1] < losses[0]
    print(
        f"lerobot {version('lerobot')}, torch {version('torch')}: {dataset.num_episodes} episodes, "
        f"every one of {len(dataset)} frames, statistics equal (quantiles within {off:.4f} of the range), "
        f"{STEPS} steps of ACT: loss {losses[0]:.2f} to {losses[-1]:.2f}"
    )


if __name__ == "__main__":
    main()
