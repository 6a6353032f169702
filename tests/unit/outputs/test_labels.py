"""Places of labels."""

import numpy as np

from warpspace.outputs.drawing.labels import Occupancy, place_label

FRAME = (0.0, 0.0, 400.0, 300.0)


def test_a_free_label_stands_close_by() -> None:
    placed = place_label([(200.0, 150.0)], (60.0, 14.0), FRAME, Occupancy(400, 300, 2.0), 1.0)
    assert placed is not None
    assert placed.cost == 0.0
    assert placed.distance < 10.0


def test_labels_stay_in_the_frame() -> None:
    taken = Occupancy(400, 300, 2.0)
    for corner in ((0.0, 0.0), (400.0, 300.0), (0.0, 300.0), (400.0, 0.0)):
        placed = place_label([corner], (60.0, 14.0), FRAME, taken, 1.0)
        assert placed is not None
        left, bottom, right, top = placed.rect
        assert left >= 0.0
        assert bottom >= 0.0
        assert right <= 400.0
        assert top <= 300.0


def test_labels_of_one_point_keep_apart() -> None:
    taken = Occupancy(400, 300, 2.0)
    rects = []
    for _ in range(6):
        placed = place_label([(200.0, 150.0)], (60.0, 14.0), FRAME, taken, 1.0)
        assert placed is not None
        rects.append(placed.rect)
    for i, a in enumerate(rects):
        for b in rects[:i]:
            apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
            assert apart, (a, b)


def test_labels_avoid_lines() -> None:
    taken = Occupancy(400, 300, 2.0)
    line = np.array([[200.0, 0.0], [200.0, 300.0]])
    taken.add_lines([line])
    placed = place_label([(200.0, 150.0)], (60.0, 14.0), FRAME, taken, 1.0)
    assert placed is not None
    assert placed.rect[0] >= 200.0 or placed.rect[2] <= 200.0


def test_a_label_wider_than_its_frame_has_no_place() -> None:
    taken = Occupancy(400, 300, 2.0)
    assert place_label([(200.0, 150.0)], (500.0, 14.0), FRAME, taken, 1.0) is None
