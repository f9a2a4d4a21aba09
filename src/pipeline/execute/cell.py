"""The robot's cell in Bullet, as in Fig. 1: two arms at a table, a cup held by one, the second container between them.

World: z up, the table's top on z = 0, the second container's opening over the origin, pours along +x. The hand holds the cup
from the side, so that the flange's axis is the tilt axis.
"""

from dataclasses import dataclass

import numpy as np
import pybullet
import pybullet_data

from pipeline.geometry import bodies
from pipeline.geometry.frames import inverse, transform

# KUKA LBR iiwa 7 R800, data sheet: speeds and torques of its joints; ranges are the model's own.
SPEED_LIMIT_RAD_S = np.radians([98.0, 98.0, 100.0, 130.0, 140.0, 180.0, 180.0])
TORQUE_LIMIT_NM = np.array([176.0, 176.0, 110.0, 110.0, 110.0, 40.0, 40.0])
STEP_S = 1.0 / 240.0
N_JOINTS = 7
FLANGE = 6
SECOND = "the second container"
READY_RAD = np.array([0.0, 0.45, 0.0, -1.65, 0.0, -0.53, 0.0])
PARKED_RAD = np.array([0.0, -0.6, 0.0, -2.0, 0.0, 0.6, 0.0])
_BASE_M = np.array([-0.10, -0.62, 0.0])
_OTHER_BASE_M = np.array([-0.10, 0.72, 0.0])
_REACH_M = 0.125  # from the cup's axis to the flange: a hand, and a handle, have room between
_GRIP_AT = 0.6  # of the cup's height
_HAND_RADIUS_M = 0.014
_CUP_KG, _HAND_KG = 0.5, 0.5  # what the last joint carries besides itself, contents included


@dataclass(frozen=True)
class Solid:
    """A container as Bullet sees it, object frame: `pieces`, convex, where it moves; the mesh `coarse` where it stands."""

    name: str
    height_m: float
    radius_m: float
    centre_m: np.ndarray
    pieces: list[np.ndarray]
    coarse: tuple[np.ndarray, np.ndarray]


def T_cup_flange(held: Solid, yaw_rad: float) -> np.ndarray:
    """Return the grasp (4, 4) of a cup whose pour direction is at `yaw_rad` in its own frame: from its right-hand side.

    Flange z: along the tilt axis, into the cup. Flange x: down when the cup is upright.
    """
    out = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    z = np.array([-out[1], out[0], 0.0])
    x = np.array([0.0, 0.0, -1.0])
    at = np.array([*held.centre_m[:2], _GRIP_AT * held.height_m]) - _REACH_M * z
    return transform(np.column_stack([x, np.cross(z, x), z]), at)


class Cell:
    """One Bullet world with the robot, a held cup and a second container; use as a context manager."""

    def __init__(self, held: Solid, second: Solid, T_world_second: np.ndarray, grasp: np.ndarray) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self.T_flange_cup = inverse(grasp)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_S, deterministicOverlappingPairs=1, physicsClientId=self._client
        )
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        self.arm = self._add_arm(_BASE_M, np.pi / 2.0, READY_RAD)
        self.other_arm = self._add_arm(_OTHER_BASE_M, -np.pi / 2.0, PARKED_RAD)
        self.table = self._fixed(self._box([0.5, 0.9, 0.02]), [0.15, 0.05, -0.02])
        self.second = self._fixed(bodies.concave(*second.coarse, self._client), [0.0, 0.0, 0.0])
        bodies.place(self.second, T_world_second, self._client)
        self.held = self._fixed(bodies.compound(held.pieces, self._client), [0.0, 0.0, 0.0])
        self.hand = self._fixed(self._hand(_REACH_M - held.radius_m), [0.0, 0.0, 0.0])
        limits = [self._limits(joint) for joint in range(N_JOINTS)]
        self.low_rad, self.high_rad = np.array(limits).T
        pybullet.changeDynamics(self.arm, FLANGE, mass=0.3 + _CUP_KG + _HAND_KG, physicsClientId=self._client)
        self._ghosts()

    def __enter__(self) -> "Cell":
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    @property
    def client(self) -> int:
        """Bullet's number of this world."""
        return self._client

    def _add_arm(self, base_m: np.ndarray, yaw_rad: float, q_rad: np.ndarray) -> int:
        turned = pybullet.getQuaternionFromEuler([0.0, 0.0, yaw_rad])
        path = f"{pybullet_data.getDataPath()}/kuka_iiwa/model.urdf"
        arm = pybullet.loadURDF(path, base_m.tolist(), turned, useFixedBase=1, physicsClientId=self._client)
        for joint, angle in enumerate(q_rad):
            pybullet.resetJointState(arm, joint, angle, physicsClientId=self._client)
        return arm

    def _limits(self, joint: int) -> tuple[float, float]:
        return pybullet.getJointInfo(self.arm, joint, physicsClientId=self._client)[8:10]

    def _fixed(self, shape: int, at_m: list[float]) -> int:
        return pybullet.createMultiBody(0.0, shape, -1, at_m, physicsClientId=self._client)

    def _box(self, halves_m: list[float]) -> int:
        return pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=halves_m, physicsClientId=self._client
        )

    def _hand(self, length_m: float) -> int:
        return pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER,
            radius=_HAND_RADIUS_M,
            height=length_m,
            collisionFramePosition=[0.0, 0.0, length_m / 2.0],
            physicsClientId=self._client,
        )

    def _ghosts(self) -> None:
        """Cup and hand follow the flange, rigidly: nothing pushes them. Contacts are looked for, and end a plan."""
        for body in (self.held, self.hand):
            pybullet.setCollisionFilterGroupMask(body, -1, 0, 0, physicsClientId=self._client)

    def frames(self) -> list[np.ndarray]:
        """Return the poses (4, 4) of the seven joints' frames in the world; the last is the flange's."""
        states = pybullet.getLinkStates(
            self.arm, list(range(N_JOINTS)), computeForwardKinematics=1, physicsClientId=self._client
        )
        return [
            transform(np.reshape(pybullet.getMatrixFromQuaternion(s[5]), (3, 3)), np.array(s[4]))
            for s in states
        ]

    def T_world_cup(self) -> np.ndarray:
        """Return where the held cup (4, 4) is, by the flange."""
        return self.frames()[FLANGE] @ self.T_flange_cup

    def joints_rad(self) -> np.ndarray:
        """Return the angles (7,) of the arm's joints."""
        states = pybullet.getJointStates(self.arm, list(range(N_JOINTS)), physicsClientId=self._client)
        return np.array([state[0] for state in states])

    def pose_arm(self, q_rad: np.ndarray) -> None:
        """Put the arm, at rest, at joint angles (7,)."""
        for joint, angle in enumerate(q_rad):
            pybullet.resetJointState(self.arm, joint, angle, 0.0, physicsClientId=self._client)

    def follow_flange(self) -> None:
        """Put cup and hand where the flange is."""
        T_world_flange = self.frames()[FLANGE]
        bodies.place(self.held, T_world_flange @ self.T_flange_cup, self._client)
        bodies.place(self.hand, T_world_flange, self._client)

    def step_towards(self, q_rad: np.ndarray, speed_rad_s: np.ndarray) -> None:
        """Let the motors drive the joints (7,) for one time step."""
        pybullet.setJointMotorControlArray(
            self.arm,
            list(range(N_JOINTS)),
            pybullet.POSITION_CONTROL,
            targetPositions=q_rad.tolist(),
            targetVelocities=speed_rad_s.tolist(),
            forces=TORQUE_LIMIT_NM.tolist(),
            positionGains=[0.3] * N_JOINTS,
            velocityGains=[1.0] * N_JOINTS,
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(physicsClientId=self._client)

    def touching(self) -> str:
        """Return what touches what, in words; nothing when all is clear. Cup, hand, arm, table, second container, other arm."""
        movers = [(self.held, "the cup"), (self.hand, "the hand")]
        still = [(self.second, SECOND), (self.table, "the table")]
        for body, name in movers:
            for other, what in (*still, (self.other_arm, "the other arm")):
                if pybullet.getClosestPoints(body, other, 0.0, physicsClientId=self._client):
                    return f"{name} touches {what}"
        for link in range(2, N_JOINTS):
            for other, what in (*still, (self.other_arm, "the other arm")):
                if pybullet.getClosestPoints(
                    self.arm, other, 0.0, linkIndexA=link, physicsClientId=self._client
                ):
                    return f"the arm's link {link + 1} touches {what}"
        return ""
