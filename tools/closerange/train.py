"""Train the network for close range on the squares of `make_samples.py`.

    python tools/closerange/train.py FOLDER OUT [--squares hands] [--steps 8000] [--seed 0] [--threads 2]
                                     [--tail-rate .1] [--share 1] [--views whole+headless+part]

Writes, every 500 steps, OUT/state.pt, from which a stopped training goes on, and OUT/curve.csv, losses and
errors; OUT/configuration.json with all numbers and the data's hash. The same seed, data, and number of
threads give the same network. Some development bodies are held back, on which the errors are measured.
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
from closerange.frozen import GRID, SETS, SIDE_PX, STRIDE, inputs_of  # noqa: E402
from closerange.network import CloseRange, Decoded  # noqa: E402
from closerange.rows import batches, chosen_rows  # noqa: E402
from hicp_lib.core.keypoints import BODY, COCO_17, FACE, HANDS, N_KEYPOINTS, SIGMAS  # noqa: E402

LIGHTNING = Path(__file__).parents[2] / "data" / "weights" / "movenet-lightning.onnx"
CHECK_STEPS = 500
BATCH, RATE, DECAY, WARM_UP = 32, 2e-3, 1e-4, 100
SIGMA_CELLS = 1.0
BODY_WEIGHT, FACE_WEIGHT, ANSWER_WEIGHT = 2.0, 0.2, 2.0
MIXED = 0.3  # parameter of how features are mixed
GROUPS = {"body": COCO_17, "face": FACE, "hand": HANDS}


def targets(keypoints_px: torch.Tensor) -> torch.Tensor:
    """Where n keypoints (n, 2) are: a Gaussian on the grid, which adds up to 1; shape (n, 2304)."""
    cells = torch.arange(GRID, dtype=torch.float32)
    at = (keypoints_px - (STRIDE - 1) / 2) / STRIDE
    rows, columns = (torch.exp(-0.5 * ((cells - at[:, k : k + 1]) / SIGMA_CELLS) ** 2) for k in (1, 0))
    maps = (rows[:, :, None] * columns[:, None, :]).flatten(1)
    return maps / maps.sum(dim=1, keepdim=True).clamp_min(1e-6)


def losses(
    network: CloseRange, features: list, points_px: torch.Tensor, seen: torch.Tensor, weights: torch.Tensor
) -> list:
    """Of positions, and of the two answers."""
    maps, answers = network(*features)
    there = seen > 0
    weight = weights.expand(seen.shape)
    log_likely = maps.flatten(2)[there].log_softmax(dim=1)
    wrong = -(targets(points_px[there]) * log_likely).sum(dim=1)
    truth = torch.stack([there, seen == 2], dim=1).float()
    answered = functional.binary_cross_entropy_with_logits(answers, truth)
    return [(wrong * weight[there]).sum() / weight[there].sum(), answered]


def restyled(features: list[torch.Tensor], share: float) -> list[torch.Tensor]:
    """Features with means and deviations of their channels mixed with those of other squares.

    Rendered pictures differ from photographs in such statistics, which the decoder is thus kept from relying
    on (Zhou et al., "Domain generalization with MixStyle", ICLR 2021). MoveNet's maps stay.
    """
    n = len(features[0])
    other, mix = torch.randperm(n), torch.distributions.Beta(MIXED, MIXED).sample((n, 1, 1, 1))
    mix = torch.where(torch.rand(n, 1, 1, 1) < share, mix, 1.0)
    changed = []
    for of in features[:3]:
        mean, deviation = of.mean(dim=(2, 3), keepdim=True), of.std(dim=(2, 3), keepdim=True) + 1e-5
        mean_to, deviation_to = (mix * own + (1 - mix) * own[other] for own in (mean, deviation))
        changed.append((of - mean) / deviation * deviation_to + mean_to)
    return [*changed, *features[3:]]


def keypoint_weights() -> torch.Tensor:
    """How much each of the 136 keypoints counts."""
    weights = torch.ones(N_KEYPOINTS)
    weights[BODY], weights[FACE] = BODY_WEIGHT, FACE_WEIGHT
    return weights


def errors(
    decoded: Decoded, features: dict, truth: dict, rows: np.ndarray, points: np.ndarray
) -> dict[str, float]:
    """Mean OKS-like similarity of visible keypoints by group, with the square's side as scale; accuracy."""
    similar, right = [], []
    with torch.no_grad():
        for k in range(0, len(rows), BATCH):
            of = rows[k : k + BATCH]
            found = decoded(*_batch(features, of)).numpy()
            true_px, seen = truth["keypoints_px"][of][:, points], truth["seen"][of][:, points]
            off_px2 = ((found[..., :2] - true_px) ** 2).sum(axis=2)
            near = np.exp(-off_px2 / 2 / (SIGMAS["halpe"][points] * SIDE_PX) ** 2)
            similar.append(np.where(seen == 2, near, np.nan))
            right.append((found[..., 3] >= 0.5) == (seen > 0))
    similarity = np.concatenate(similar)
    groups = {name: np.isin(points, of) for name, of in GROUPS.items()}
    by_group = {name: float(np.nanmean(similarity[:, of])) for name, of in groups.items() if of.any()}
    return by_group | {"in_picture_right": float(np.concatenate(right).mean())}


def _batch(features: dict[str, np.ndarray], rows: np.ndarray) -> list[torch.Tensor]:
    chosen = (torch.from_numpy(np.asarray(of[np.sort(rows)], np.float32)) for of in features.values())
    return [of.to(memory_format=torch.channels_last) for of in chosen]  # half the time


def start(options: argparse.Namespace) -> tuple[CloseRange, dict]:
    """The network, and all that is stored of a training."""
    network = CloseRange(LIGHTNING, options.squares, options.width).to(memory_format=torch.channels_last)
    network.tail.requires_grad_(options.tail_rate > 0)
    average = torch.optim.swa_utils.AveragedModel(
        network, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(options.average), use_buffers=True
    )
    rest = [parameter for name, parameter in network.named_parameters() if not name.startswith("tail.")]
    tail = {"params": list(network.tail.parameters()), "lr": RATE * options.tail_rate}
    optimizer = torch.optim.AdamW([{"params": rest}, tail], RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer,
        lambda k: min(1, (k + 1) / WARM_UP) * (1 + math.cos(math.pi * min(1, k / options.steps))) / 2,
    )
    return network, {"network": network, "average": average, "optimizer": optimizer, "schedule": schedule}


def resume(out: Path, parts: dict, numbers: dict) -> tuple[int, list[dict]]:
    """Steps done and the curve of a stopped training, whose state is put into the parts; else 0 and none."""
    configuration, done, curve = out / "configuration.json", 0, []
    if (out / "state.pt").exists():
        before = json.loads(configuration.read_text())
        if others := [name for name in numbers | before if numbers.get(name) != before.get(name)]:
            sys.exit(f"{out} was begun with other values of {', '.join(others)}; give another folder")
        state = torch.load(out / "state.pt", weights_only=True)
        for name, part in parts.items():
            part.load_state_dict(state[name])
        done, curve = state["step"], pd.read_csv(out / "curve.csv").to_dict("records")
    configuration.write_text(json.dumps(numbers, indent=1) + "\n")
    return done, curve


def train(options: argparse.Namespace) -> None:
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.threads)
    torch.use_deterministic_algorithms(True)
    folder, out = options.folder, options.out
    out.mkdir(parents=True, exist_ok=True)
    of, keypoints, squares = options.squares, SETS[options.squares], folder / options.squares
    truth, features = load_truth(squares), load_features(squares, LIGHTNING, inputs_of(of), options.threads)
    training, checking = chosen_rows(truth, options.views, options.share)
    weights = keypoint_weights()[keypoints]
    network, parts = start(options)
    numbers = {name: value for name, value in vars(options).items() if name not in ("folder", "out")} | {
        "batch": BATCH, "rate": RATE, "decay": DECAY,
        "body_weight": BODY_WEIGHT, "face_weight": FACE_WEIGHT, "answer_weight": ANSWER_WEIGHT,
        "n_training": len(training), "n_checking": len(checking), "squares_sha256": squares_sha256(squares),
        "held_back": sorted(set(truth["body"][checking])), "torch": torch.__version__,
    }  # fmt: skip
    done, curve = resume(out, parts, numbers)
    sums, began = [], time.perf_counter()
    for step, rows in enumerate(batches(training, BATCH, options.seed, done, options.steps), done + 1):
        network.train()
        torch.manual_seed(options.seed + 1_000_003 * step)  # a stopped training goes on as if it had not been
        true_px, seen = (
            torch.from_numpy(truth[name][rows][:, keypoints]) for name in ("keypoints_px", "seen")
        )
        parts["optimizer"].zero_grad()
        given = restyled(_batch(features, rows), options.restyle)
        wrong, answered = losses(network, given, true_px, seen, weights)
        (wrong + ANSWER_WEIGHT * answered).backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        parts["optimizer"].step()
        parts["schedule"].step()
        parts["average"].update_parameters(network)
        sums.append((wrong.item(), answered.item()))
        if step % CHECK_STEPS and step != options.steps:
            continue
        at = {"step": step} | dict(zip(("loss_position", "loss_answers"), np.mean(sums, axis=0), strict=True))
        decoded = Decoded(parts["average"].module, of).eval()
        curve.append(at | errors(decoded, features, truth, checking, keypoints))
        said = {name: round(float(value), 3) for name, value in curve[-1].items()}
        print(f"{time.perf_counter() - began:.0f} s", said, flush=True)
        pd.DataFrame(curve).to_csv(out / "curve.csv", index=False, lineterminator="\n", float_format="%.5f")
        state = {name: part.state_dict() for name, part in parts.items()} | {"step": step}
        torch.save(state, out / "state.part")
        (out / "state.part").replace(out / "state.pt")
        sums = []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--squares", choices=list(SETS), default="people")
    parser.add_argument("--steps", type=int, default=8000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument(
        "--tail-rate", type=float, default=0.1, help="of MoveNet's layers, as part of the rest's"
    )
    parser.add_argument("--restyle", type=float, default=0.5, help="share of squares with mixed features")
    parser.add_argument("--average", type=float, default=0.998, help="of the running mean of the weights")
    parser.add_argument("--share", type=float, default=1.0, help="of the squares, for the learning curve")
    parser.add_argument("--views", default="", help="kinds of squares of people, joined by +; all of them")
    train(parser.parse_args())


if __name__ == "__main__":
    main()
