"""RULA and REBA as the papers' words and the printed worksheets have them, step by step and in degrees.

Written from the sources alone: L. McAtamney and E. N. Corlett, Applied Ergonomics 24(2), 1993; S. Hignett and L.
McAtamney, Applied Ergonomics 31, 2000, and their chapter 8 of the Handbook of Human Factors and Ergonomics Methods,
2005; the worksheets of A. Hedge (Cornell University). What the words leave open ("raised", "abducted", "twisted", "in
extension") has the bounds that `wholebody.ergonomics.observation` states.
"""

from __future__ import annotations

from functools import cache
from math import degrees

from wholebody.ergonomics.angles import BodyAngles
from wholebody.ergonomics.work import Work, both_feet

RULA_A = """
12222333 22223333 23333344
23333444 33333444 34444455
33444455 34444455 44444555
44444555 44444555 44455566
55555667 56666777 66677778
77777889 88888999 99999999
"""  # upper arm by lower arm; in a number wrist and twist
RULA_B = "132334556677 232345556777 333445566777 555667777788 777778888888 888888899999"  # neck; trunk and legs
RULA_C = "1233455 2234455 3334456 3334566 4445677 4456677 5566777 5567777"

REBA_A = """
1234 1234 3356
2345 3456 4567
2456 4567 5678
3567 5678 6789
4678 6789 7899
"""  # trunk by neck; in a number legs
REBA_B = "122 123 123 234 345 455 455 567 678 788 788 899"  # upper arm by lower arm; in a number wrist
REBA_C = """
111233456777  122344566778  233345677888  344456788999
444567889999  66678899AAAA  7778999AABBB  8889AAAAABBB
999AAABBBCCC  AAABBBBCCCCC  BBBBCCCCCCCC  CCCCCCCCCCCC
"""  # score of table A by that of table B; hexadecimal


def rula(body: BodyAngles, side: str, work: Work) -> int:
    """The grand score of one side; `work.seated` is decided."""
    arm = getattr(body, side)
    # steps 1 to 4: arm and wrist
    upper = upper_arm(degrees(arm.shoulder_flexion), arm.shoulder_rise, degrees(arm.shoulder_abduction), work)
    lower = 1 if 60 <= degrees(arm.elbow_flexion) <= 100 else 2
    if arm.across or degrees(arm.forearm_outward) > 30:
        lower += 1
    bend = degrees(arm.wrist_flexion)
    if -5 <= bend <= 5:
        wrist = 1
    elif -15 <= bend <= 15:
        wrist = 2
    else:
        wrist = 3
    if not -10 <= degrees(arm.wrist_deviation) <= 10:
        wrist += 1
    twist = 1 if -45 <= degrees(arm.forearm_twist) <= 45 else 2
    # steps 9 to 11: neck, trunk and legs
    nod = degrees(body.neck_flexion)
    if nod < -5:
        neck = 4
    elif nod <= 10:
        neck = 1
    elif nod <= 20:
        neck = 2
    else:
        neck = 3
    neck += int(abs(degrees(body.neck_twist)) > 10) + int(abs(degrees(body.neck_lateral)) > 10)
    stoop = abs(degrees(body.trunk_flexion))
    thigh = max(degrees(body.left.thigh_slope), degrees(body.right.thigh_slope))
    if work.seated and work.back_supported and 180 - thigh - degrees(body.trunk_flexion) >= 90:
        trunk = 1
    elif stoop <= 5:
        trunk = 2 if work.seated and work.back_supported is False else 1
    elif stoop <= 20:
        trunk = 2
    elif stoop <= 60:
        trunk = 3
    else:
        trunk = 4
    trunk += int(abs(degrees(body.trunk_twist)) > 10) + int(abs(degrees(body.trunk_lateral)) > 10)
    legs = 1 if work.legs_supported and (work.seated or both_feet(body)) else 2
    # steps 5 to 8 and 12 to 15
    muscle = 1 if work.static or work.repeated else 0
    if work.shock:
        force = 3
    elif work.load < 2:
        force = 0
    elif work.load <= 10:
        force = 1 if not muscle else 2
    else:
        force = 2 if not muscle else 3
    a = _digit(RULA_A, (6, 3, 4, 2), upper, lower, wrist, twist) + muscle + force
    b = _digit(RULA_B, (6, 6, 2), neck, trunk, legs) + muscle + force
    return _digit(RULA_C, (8, 7), min(a, 8), min(b, 7))


def reba(body: BodyAngles, side: str, work: Work) -> int:
    """The score of one side; `work.seated` is decided."""
    arm = getattr(body, side)
    # group A, scored once: trunk, neck, legs
    stoop = degrees(body.trunk_flexion)
    if stoop > 60:
        trunk = 4
    elif stoop > 20 or stoop < -20:
        trunk = 3
    elif stoop > 5 or stoop < -5:
        trunk = 2
    else:
        trunk = 1
    if abs(degrees(body.trunk_twist)) > 10 or abs(degrees(body.trunk_lateral)) > 10:
        trunk += 1
    neck = 1 if -5 <= degrees(body.neck_flexion) <= 20 else 2
    if abs(degrees(body.neck_twist)) > 10 or abs(degrees(body.neck_lateral)) > 10:
        neck += 1
    knees = [degrees(body.left.knee_flexion), degrees(body.right.knee_flexion)]
    if work.seated:
        legs = 1
    else:
        legs = 1 if both_feet(body) or work.walking else 2
        if any(knee > 60 for knee in knees):
            legs += 2
        elif any(knee >= 30 for knee in knees):
            legs += 1
    load = 0 if work.load < 5 else 1 if work.load <= 10 else 2
    a = _digit(REBA_A, (5, 3, 4), trunk, neck, legs) + load + (1 if work.shock else 0)
    # group B: upper arm, lower arm, wrist
    upper = upper_arm(degrees(arm.shoulder_flexion), arm.shoulder_rise, degrees(arm.shoulder_abduction), work)
    lower = 1 if 60 <= degrees(arm.elbow_flexion) <= 100 else 2
    wrist = 1 if -15 <= degrees(arm.wrist_flexion) <= 15 else 2
    if abs(degrees(arm.wrist_deviation)) > 10 or abs(degrees(arm.forearm_twist)) > 45:
        wrist += 1
    grip = {"good": 0, "fair": 1, "poor": 2, "unacceptable": 3}[work.coupling]
    b = _digit(REBA_B, (6, 2, 3), upper, lower, wrist) + grip
    activity = [work.static, work.repeated, work.unstable].count(True)
    return _digit(REBA_C, (12, 12), min(a, 12), min(b, 12)) + activity


def upper_arm(flexion: float, rise: float, abduction: float, work: Work) -> int:
    """Score of an upper arm in both methods."""
    if -20 <= flexion <= 20:
        score = 1
    elif flexion < -20 or flexion <= 45:
        score = 2
    elif flexion <= 90:
        score = 3
    else:
        score = 4
    if rise > 0.03:
        score += 1
    if abduction > 20:
        score += 1
    if work.arms_supported:
        score -= 1
    return max(score, 1)


@cache
def digits(sheet: str) -> list[int]:
    """The entries of a sheet in the order in which it is printed."""
    return [int(digit, 16) for digit in "".join(sheet.split())]


def _digit(sheet: str, sizes: tuple[int, ...], *scores: int) -> int:
    place = 0
    for size, score in zip(sizes, scores, strict=True):
        if not 1 <= score <= size:
            raise ValueError(f"a score of {score} in a table of {size}")
        place = place * size + score - 1
    return digits(sheet)[place]
