"""Random MJCF documents for `compare_mjcf_with_mujoco.py`: `python tests/python/random_mjcf.py 150 FOLDER`.

Trees of up to five generations with all joints, several in a body, all shapes, orientations in every
spelling, frames, nested defaults, and settings of the compiler. Documents follow from their numbers.
"""

import sys
from pathlib import Path
from random import Random

DEFAULTS = """<default><joint damping="0.3"/><geom density="800"/>
<default class="c1"><joint damping="1" ref="5"/><geom density="500"/>
<default class="c2"><joint pos="0.1 0 0"/><geom euler="0 0 30"/></default></default></default>"""
CLASSES = ["", 'class="c1"', 'class="c2"']


class Document:
    """What is random in one document, and how many bodies it has so far."""

    def __init__(self, seed):
        self.random, self.n_bodies = Random(seed), 0

    def often(self, probability, text):
        return text if self.random.random() < probability else ""

    def numbers(self, count, size=1.0):
        return " ".join(f"{self.random.uniform(-size, size):.4f}" for _ in range(count))

    def orientation(self):
        spellings = (
            "",
            f'quat="{self.numbers(4)}"',
            f'euler="{self.numbers(3, 100)}"',
            f'axisangle="{self.numbers(3)} {self.random.uniform(-200, 200):.3f}"',
            f'xyaxes="{self.numbers(6)}"',
            f'zaxis="{self.numbers(3)}"',
        )
        return self.random.choice(spellings)

    def geom(self):
        shape = self.random.choice(["sphere", "capsule", "cylinder", "box", "ellipsoid"])
        size = [f"{self.random.uniform(0.02, 0.3):.4f}" for _ in range(3)]
        masses = (
            "",
            f'mass="{self.random.uniform(0.1, 3):.3f}"',
            f'density="{self.random.uniform(100, 3000):.1f}"',
        )
        given = f"{self.random.choice(masses)} {self.random.choice(CLASSES)}"
        if shape != "sphere" and self.random.random() < 0.4:
            return f'<geom type="{shape}" size="{size[0]}" fromto="{self.numbers(6)}" {given}/>'
        pose = f'pos="{self.numbers(3, 0.3)}" {self.orientation()}'
        group = self.random.randint(0, 2)
        return f'<geom type="{shape}" size="{" ".join(size)}" {pose} {given} group="{group}"/>'

    def joints(self):
        found, ball = "", False
        for _ in range(self.random.choice([0, 1, 1, 1, 2, 3])):
            kind = self.random.choice(["hinge", "hinge", "slide", "ball"])
            kind = "slide" if ball else kind  # MuJoCo has no hinge and no ball after a ball
            ball |= kind == "ball"
            place = self.often(0.5, f'pos="{self.numbers(3, 0.3)}"')
            reference = "" if kind == "ball" else self.often(0.5, f'ref="{self.numbers(1, 30)}"')
            damping = self.often(0.5, f'damping="{self.random.uniform(0, 2):.3f}"')
            given = f"{place} {reference} {self.random.choice(CLASSES)} {damping}"
            found += f'<joint type="{kind}" axis="{self.numbers(3)}" {given}/>'
        return found

    def inertial(self):
        moments = sorted(self.random.uniform(0.01, 0.1) for _ in range(3))
        moments[2] = min(moments[2], 0.95 * (moments[0] + moments[1]))
        self.random.shuffle(moments)
        diagonal = " ".join(f"{moment:.6f}" for moment in moments)
        mass = self.random.uniform(0.1, 4)
        place = f'pos="{self.numbers(3, 0.3)}" {self.orientation()}'
        return f'<inertial {place} mass="{mass:.3f}" diaginertia="{diagonal}"/>'

    def body(self, generation=0):
        self.n_bodies += 1
        name = f"b{self.n_bodies}"
        if generation == 0 and self.random.random() < 0.4:
            inner = self.random.choice(["<freejoint/>", '<joint type="free"/>'])
        else:
            inner = self.joints()
        if self.random.random() < 0.3:
            inner += self.inertial() + self.often(0.5, self.geom())
        else:
            inner += "".join(self.geom() for _ in range(self.random.randint(1, 3)))
        frame = f'<frame pos="{self.numbers(3)}" {self.orientation()}'
        inner += self.often(0.3, f"{frame}>{self.geom()}</frame>")
        for _ in range(self.random.choice([0, 1, 1, 2]) if generation < 4 else 0):
            child = self.body(generation + 1)
            inner += f'{frame} childclass="c2">{child}</frame>' if self.random.random() < 0.3 else child
        classed = self.often(0.3, 'childclass="c1"')
        return f'<body name="{name}" pos="{self.numbers(3)}" {self.orientation()} {classed}>{inner}</body>'

    def text(self):
        sequence = self.random.choice(["xyz", "XYZ", "zyx", "ZyX", "xyx"])
        geometry = self.random.choice(["auto", "true"])
        compiler = (
            f'eulerseq="{sequence}"',
            self.often(0.5, 'inertiagrouprange="0 1"'),
            self.often(0.5, 'boundmass="0.3" boundinertia="0.02"'),
            f'balanceinertia="true" inertiafromgeom="{geometry}"',
        )
        bodies = "".join(self.body() for _ in range(self.random.choice([1, 1, 2])))
        return f"""<mujoco model="random"><compiler {" ".join(compiler)}/>{DEFAULTS}
<option gravity="{self.numbers(3, 10)}"/><worldbody>{bodies}</worldbody></mujoco>
"""


def main():
    count, folder = int(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(count):
        (folder / f"{seed:03}.xml").write_text(Document(seed).text(), "utf-8")


if __name__ == "__main__":
    main()
