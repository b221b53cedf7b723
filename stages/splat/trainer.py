"""Gaussians that learn from posed pictures while these arrive."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.pose_graph import Edge
from scenewright.stages.kit.registration.rigid_motion import inverses
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.rasterizer import Drawn, Rasterizer, View
from scenewright.stages.splat.adjustment import Adjustment
from scenewright.stages.splat.density import Pull, grown, useless
from scenewright.stages.splat.losses import loss_of
from scenewright.stages.splat.methods.method import Method
from scenewright.stages.splat.optimizer import RowAdam
from scenewright.stages.splat.seeding import Seeds, seen_through
from scenewright.stages.splat.views import PosedView
from scipy.spatial.transform import Rotation

MOMENTS = (0.9, 0.999)
"""Decay of the moments of Adam, for poses (Kingma and Ba 2015)."""


@dataclass(frozen=True)
class TrainerState:
    """What a trainer holds beside Gaussians and views."""

    moments: dict[str, np.ndarray]
    moved: np.ndarray
    """(N,) how often each Gaussian was moved."""
    pull: np.ndarray
    """(2, N) sums and counts."""
    origins: np.ndarray
    """(N,) the view that set each Gaussian."""
    guessed: np.ndarray
    """(N,) which were set where no depth was measured."""
    edges: list[Edge]
    tried: list[tuple[int, int]]
    """Of the adjustment."""
    steps: int
    rounds: int
    was_reset: bool


@dataclass
class Learned:
    """A view in training: its pose moves where poses are refined."""

    view: PosedView
    camera_from_world: np.ndarray
    first: np.ndarray
    second: np.ndarray
    steps: int = 0


class Trainer:
    """Holds the Gaussians and the views; `step` makes them agree a little better.

    `refine_poses`: poses are learned too, but for that of the first view, which holds the world still. `adjust_every`:
    the poses of all views are adjusted together whenever so many have arrived; 0: never. `most`: pictures bring no
    further Gaussians once there are so many.
    """

    def __init__(
        self,
        method: Method,
        rasterizer: Rasterizer,
        random: np.random.Generator,
        *,
        refine_poses: bool = False,
        adjust_every: int = 0,
        most: int = 10**7,
    ) -> None:
        self.method, self.rasterizer, self.random = method, rasterizer, random
        self.refine_poses, self.adjust_every, self.most = refine_poses, adjust_every, most
        self.adjustment = Adjustment()
        self.gaussians = no_gaussians()
        self.views: list[Learned] = []
        self.steps = 0
        self._adam, self._pull = RowAdam(), Pull(0)
        self._rounds, self._was_reset = 0, False
        self._origins, self._guessed = np.zeros(0, np.int64), np.zeros(0, bool)

    @property
    def moves_poses(self) -> bool:
        """Whether views do not stay where they were given."""
        return self.refine_poses or self.adjust_every > 0

    def state(self) -> TrainerState:
        """Return what a checkpoint holds of it."""
        pull = np.stack([self._pull.sums, self._pull.seen])
        return TrainerState(
            self._adam.moments,
            self._adam.steps,
            pull,
            self._origins,
            self._guessed,
            self.adjustment.edges,
            sorted(self.adjustment.tried),
            self.steps,
            self._rounds,
            self._was_reset,
        )

    def go_on(self, gaussians: Gaussians, views: list[Learned], state: TrainerState) -> None:
        """Go on from where another trainer was."""
        self.gaussians, self.views, self.steps = gaussians, views, state.steps
        self._adam.moments, self._adam.steps = state.moments, state.moved
        self._pull.sums, self._pull.seen = state.pull
        self._rounds, self._was_reset = state.rounds, state.was_reset
        self._origins, self._guessed = state.origins, state.guessed
        self.adjustment.edges, self.adjustment.tried = list(state.edges), set(state.tried)

    def add_view(self, view: PosedView, *, last: bool = False) -> None:
        """Take a new picture in: guesses that it sees through go, and Gaussians are set where the method wants them.

        After the `last` all are adjusted.
        """
        pose = view.camera_from_world.copy()
        if self.adjust_every and self.views:
            # The motion since the view before is taken as it is given, until it is adjusted.
            before = self.views[-1]
            pose = pose @ inverse(before.view.camera_from_world) @ before.camera_from_world
        self.views.append(Learned(view, pose, np.zeros(6), np.zeros(6)))
        if self.adjust_every and (last or len(self.views) % self.adjust_every == 0):
            self._adjust()
        learned = self.views[-1]
        guesses = np.flatnonzero(self._guessed)
        remaining = np.ones(len(self.gaussians), bool)
        remaining[guesses] = ~seen_through(self.gaussians.means[guesses], view, learned.camera_from_world)
        if not remaining.all():
            self._keep(remaining)
        drawn = self.draw(learned).picture
        seeded, guessed = self.method.seed(view, drawn, learned.camera_from_world, self.random)
        room = max(0, self.most - len(self.gaussians))
        if len(seeded) > room:
            rows = np.sort(self.random.permutation(len(seeded))[:room])
            seeded, guessed = seeded.taken(rows), guessed[rows]
        self._add(Seeds(seeded, guessed), np.full(len(seeded), len(self.views) - 1))

    def _adjust(self) -> None:
        before = inverses(np.array([each.camera_from_world for each in self.views]))
        after = self.adjustment.adjusted([each.view for each in self.views], before)
        for each, pose in zip(self.views, after, strict=True):
            each.camera_from_world = inverse(pose)
        if self.method.carried:
            move(self.gaussians, (after @ inverses(before))[self._origins])

    def draw(self, learned: Learned) -> Drawn:
        """Return what a view shows of the Gaussians now."""
        return self.rasterizer.draw(self.gaussians, View(learned.view.camera, learned.camera_from_world))

    def step(self) -> float:
        """Compare one view, drawn at random, with what is shown of it, and improve; return the loss before.

        Raises BadInput where there is nothing to learn from, or where the loss is no number any more.
        """
        if not self.views or not len(self.gaussians):
            raise BadInput("no Gaussians to train: no picture has depth", hint="give a sequence with depth")
        learned = self.views[int(self.random.integers(len(self.views)))]
        drawn = self.draw(learned)
        view = learned.view
        loss, by = loss_of(drawn.picture, view.color, view.depth, self.method.loss)
        if not np.isfinite(loss):
            raise BadInput(
                f"frame {view.frame}: the loss is not a number after {self.steps} steps", hint="look at its depth"
            )
        gradients = drawn.backward(by)
        rates = {name: rate.at(self.steps) for name, rate in self.method.rates.items()}
        moved = drawn.visible if self.method.visible_alone else np.ones(len(self.gaussians), bool)
        self._adam.step(self.gaussians, gradients, rates, moved)
        self._pull.add(gradients.centers, drawn.visible, view.camera.width, view.camera.height)
        if self.refine_poses and learned is not self.views[0]:
            _move(learned, gradients.twist, self.method.pose_rate.at(self.steps))
        self.steps += 1
        if self.steps % self.method.degree_every == 0:
            self._raise_degree()
        density = self.method.density
        if self.steps >= density.begin and self.steps % density.every == 0:
            self._change_density()
        return loss

    def _raise_degree(self) -> None:
        degree = min(3, self.steps // self.method.degree_every)
        self.gaussians = with_harmonics(self.gaussians, (degree + 1) ** 2)
        self._adam.extend(self.gaussians)

    def _add(self, more: Seeds, origins: np.ndarray) -> None:
        self._origins = np.concatenate([self._origins, origins])
        self._guessed = np.concatenate([self._guessed, more.guessed])
        self.gaussians = self.gaussians.joined(with_harmonics(more.gaussians, self.gaussians.harmonics.shape[1]))
        self._adam.extend(self.gaussians)
        self._pull.extend(len(self.gaussians))

    def _keep(self, kept: np.ndarray) -> None:
        self.gaussians = self.gaussians.taken(kept)
        self._adam.keep(kept)
        self._pull.keep(kept)
        self._origins, self._guessed = self._origins[kept], self._guessed[kept]

    def _change_density(self) -> None:
        density = self.method.density
        self._rounds += 1
        added, parents, gone = grown(self.gaussians, self._pull.means(), density, self.random)
        seeds, origins = Seeds(added, self._guessed[parents]), self._origins[parents]
        gone |= useless(self.gaussians, density, self._was_reset)
        self._keep(~gone)
        self._pull = Pull(len(self.gaussians))
        self._add(seeds, origins)
        if density.reset_every and self._rounds % density.reset_every == 0:
            least = 2 * density.least_opacity
            np.minimum(
                self.gaussians.logit_opacities,
                np.float32(np.log(least / (1 - least))),
                out=self.gaussians.logit_opacities,
            )
            self._adam.forget("logit_opacities")
            self._was_reset = True


def no_gaussians() -> Gaussians:
    """Return none."""
    shapes = ((0, 3), (0, 4), (0, 3), (0,), (0, 1, 3), (0, 0))
    return Gaussians(*(np.zeros(shape, np.float32) for shape in shapes))


def with_harmonics(gaussians: Gaussians, count: int) -> Gaussians:
    """Return the Gaussians with at least `count` coefficients a colour; those that are added are 0."""
    had = gaussians.harmonics.shape[1]
    if had >= count:
        return gaussians
    harmonics = np.zeros((len(gaussians), count, 3), np.float32)
    harmonics[:, :had] = gaussians.harmonics
    return replace(gaussians, harmonics=harmonics)


def move(gaussians: Gaussians, motions: np.ndarray) -> None:
    """Move every Gaussian by its motion (N, 4, 4), in place. Their colours keep the directions that they had."""
    if not len(gaussians):
        return
    gaussians.means[:] = np.einsum("nij,nj->ni", motions[:, :3, :3], gaussians.means) + motions[:, :3, 3]
    turned = Rotation.from_matrix(motions[:, :3, :3]) * Rotation.from_quat(np.roll(gaussians.quaternions, -1, axis=1))
    gaussians.quaternions[:] = np.roll(turned.as_quat(), 1, axis=1)


def _move(learned: Learned, twist: np.ndarray, rate: float) -> None:
    """Move a view's pose by one step of Adam along its twist (6,), translation and rotation."""
    learned.steps += 1
    learned.first = MOMENTS[0] * learned.first + (1 - MOMENTS[0]) * twist
    learned.second = MOMENTS[1] * learned.second + (1 - MOMENTS[1]) * twist * twist
    first = learned.first / (1 - MOMENTS[0] ** learned.steps)
    second = learned.second / (1 - MOMENTS[1] ** learned.steps)
    step = -rate * first / (np.sqrt(second) + 1e-12)
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = Rotation.from_rotvec(step[3:]).as_matrix(), step[:3]
    learned.camera_from_world = turn @ learned.camera_from_world
