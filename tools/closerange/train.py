"""Train the network for close range on the squares of `make_samples.py`.

    python tools/closerange/train.py FOLDER OUT [--epochs 8] [--seed 0] [--threads 2] [--share 1]
                                     [--tail-rate .1]

Writes OUT/state.pt after each epoch, from which a stopped training goes on; OUT/curve.csv, losses and errors
per epoch; OUT/configuration.json with all numbers and the data's hash. The same seed, data, and number of
threads give the same network. Some development identities are held back to see when to stop.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch.nn import functional

sys.path.insert(0, str(Path(__file__).parents[1]))

from closerange.features import load_features, load_truth, squares_sha256  # noqa: E402
from closerange.frozen import GRID, SIDE_PX, STRIDE  # noqa: E402
from closerange.network import CloseRange, Decoded  # noqa: E402
from hicp_lib.core.keypoints import BODY, COCO_17, FACE, HANDS, SIGMAS  # noqa: E402

LIGHTNING = Path(__file__).parents[2] / "data" / "weights" / "movenet-lightning.onnx"
HELD_BACK = 4
"""Development identities, the last of their sorted names, that only tell when to stop."""
BATCH, RATE, DECAY, WARM_UP = 32, 2e-3, 1e-4, 100
SIGMA_CELLS = 1.0
HIDDEN_WEIGHT, BODY_WEIGHT, FACE_WEIGHT, ANSWER_WEIGHT = 0.3, 2.0, 0.2, 2.0
AVERAGE = 0.998  # of the running mean of the weights


def targets(keypoints_px: torch.Tensor) -> torch.Tensor:
    """Where n keypoints (n, 2) are: a Gaussian on the grid, which adds up to 1; shape (n, 2304)."""
    cells = torch.arange(GRID, dtype=torch.float32)
    at = (keypoints_px - (STRIDE - 1) / 2) / STRIDE
    rows, columns = (torch.exp(-0.5 * ((cells - at[:, k : k + 1]) / SIGMA_CELLS) ** 2) for k in (1, 0))
    maps = (rows[:, :, None] * columns[:, None, :]).flatten(1)
    return maps / maps.sum(dim=1, keepdim=True).clamp_min(1e-6)


def losses(network: CloseRange, features: list, keypoints_px: torch.Tensor, seen: torch.Tensor) -> list:
    """Of positions, and of the two answers."""
    maps, answers = network(*features)
    there = seen > 0
    weight = torch.where(seen == 2, 1.0, HIDDEN_WEIGHT)
    weight[:, BODY] *= BODY_WEIGHT
    weight[:, FACE] *= FACE_WEIGHT
    log_likely = maps.flatten(2)[there].log_softmax(dim=1)
    wrong = -(targets(keypoints_px[there]) * log_likely).sum(dim=1)
    truth = torch.stack([there, seen == 2], dim=1).float()
    answered = functional.binary_cross_entropy_with_logits(answers, truth)
    return [(wrong * weight[there]).sum() / weight[there].sum(), answered]


def errors(network: CloseRange, features: dict, truth: dict, rows: np.ndarray) -> dict[str, float]:
    """Mean OKS-like similarity of visible keypoints by group, with the square's side as scale; accuracy."""
    decoded = Decoded(network).eval()
    similar, right = [], []
    with torch.no_grad():
        for k in range(0, len(rows), BATCH):
            of = rows[k : k + BATCH]
            found = decoded(*_batch(features, of)).numpy()
            points, seen = truth["keypoints_px"][of], truth["seen"][of]
            off = ((found[..., :2] - points) ** 2).sum(axis=2)
            similar.append(
                np.where(seen == 2, np.exp(-off / 2 / (2 * SIGMAS["halpe"] * SIDE_PX / 2) ** 2), np.nan)
            )
            right.append((found[..., 3] >= 0.5) == (seen > 0))
    similarity = np.concatenate(similar)
    groups = {"body": COCO_17, "face": FACE, "hand": HANDS}
    by_group = {name: float(np.nanmean(similarity[:, of])) for name, of in groups.items()}
    return by_group | {"in_picture_right": float(np.concatenate(right).mean())}


def _batch(features: dict[str, np.ndarray], rows: np.ndarray) -> list[torch.Tensor]:
    return [torch.from_numpy(np.asarray(of[np.sort(rows)], np.float32)) for of in features.values()]


def train(
    folder: Path, out: Path, epochs: int, seed: int, threads: int, width: int, share: float, tail_rate: float
) -> None:
    torch.manual_seed(seed)
    torch.set_num_threads(threads)
    torch.use_deterministic_algorithms(True)
    out.mkdir(parents=True, exist_ok=True)
    truth, features = load_truth(folder), load_features(folder, LIGHTNING, threads)
    names = sorted(set(truth["identity"]))
    back = np.isin(truth["identity"], names[-HELD_BACK:])
    training, checking = np.flatnonzero(~back), np.flatnonzero(back)
    training = training[: int(share * len(training))]
    network = CloseRange(LIGHTNING, width)
    network.tail.requires_grad_(tail_rate > 0)
    average = torch.optim.swa_utils.AveragedModel(
        network, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(AVERAGE), use_buffers=True
    )
    tail, rest = (
        list(network.tail.parameters()),
        [of for n, of in network.named_parameters() if n[:5] != "tail."],
    )
    groups = [{"params": rest, "lr": RATE}, {"params": tail, "lr": RATE * tail_rate}]
    optimizer = torch.optim.AdamW(groups, RATE, weight_decay=DECAY)
    steps = epochs * (len(training) // BATCH)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda k: min(1, (k + 1) / WARM_UP) * 0.5 * (1 + math.cos(math.pi * min(1, k / steps)))
    )
    configuration = {
        "epochs": epochs, "seed": seed, "threads": threads, "width": width, "batch": BATCH, "rate": RATE,
        "decay": DECAY, "hidden_weight": HIDDEN_WEIGHT, "face_weight": FACE_WEIGHT, "share": share,
        "answer_weight": ANSWER_WEIGHT, "n_training": len(training), "n_checking": len(checking),
        "held_back": names[-HELD_BACK:], "tail_rate": tail_rate, "body_weight": BODY_WEIGHT,
        "squares_sha256": squares_sha256(folder), "torch": torch.__version__,
    }  # fmt: skip
    (out / "configuration.json").write_text(json.dumps(configuration, indent=1) + "\n")
    start, curve = 0, []
    if (out / "state.pt").exists():
        state = torch.load(out / "state.pt", weights_only=True)
        for of, name in (
            (network, "network"),
            (average, "average"),
            (optimizer, "optimizer"),
            (schedule, "schedule"),
        ):
            of.load_state_dict(state[name])
        start, curve = state["epoch"], pd.read_csv(out / "curve.csv").to_dict("records")
    for epoch in range(start, epochs):
        order = np.random.default_rng([seed, epoch]).permutation(training)
        sums, began = np.zeros(2), time.perf_counter()
        network.train()
        for k in range(len(order) // BATCH):
            rows = np.sort(order[k * BATCH : (k + 1) * BATCH])
            points, seen = (torch.from_numpy(truth[name][rows]) for name in ("keypoints_px", "seen"))
            optimizer.zero_grad()
            parts = losses(network, _batch(features, rows), points, seen)
            (parts[0] + ANSWER_WEIGHT * parts[1]).backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimizer.step()
            schedule.step()
            average.update_parameters(network)
            sums += [float(part) for part in parts]
        at = {"epoch": epoch + 1, "loss_position": sums[0] / (k + 1), "loss_answers": sums[1] / (k + 1)}
        curve.append(at | errors(average.module, features, truth, checking))
        print(
            f"{time.perf_counter() - began:.0f} s", {k: round(v, 3) for k, v in curve[-1].items()}, flush=True
        )
        pd.DataFrame(curve).to_csv(out / "curve.csv", index=False, lineterminator="\n", float_format="%.5f")
        parts = {"network": network, "average": average, "optimizer": optimizer, "schedule": schedule}
        torch.save(
            {name: of.state_dict() for name, of in parts.items()} | {"epoch": epoch + 1}, out / "state.pt"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--epochs", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument(
        "--tail-rate", type=float, default=0.1, help="of MoveNet's layers, as part of the rest's"
    )
    parser.add_argument("--share", type=float, default=1.0, help="of the squares, for the learning curve")
    train(**vars(parser.parse_args()))


if __name__ == "__main__":
    main()
