"""Whose request is next."""

from app.web.turns import Lane, TurnQueue, lane_of

KIOSK = "127.0.0.1"


def test_commands_go_first_then_the_kiosk_then_others() -> None:
    queue: TurnQueue[str] = TurnQueue(10, 10)
    for client, command, item in [
        ("192.0.2.1", False, "a page elsewhere"),
        (KIOSK, False, "a page at the kiosk"),
        ("192.0.2.1", True, "a press elsewhere"),
        (KIOSK, True, "a press at the kiosk"),
    ]:
        queue.add(client, lane_of(client, command), item)
    order = []
    while (lane := queue.next_lane(reads=True)) is not None:
        order.append(queue.take(lane))
    assert order == [
        *("a press elsewhere", "a press at the kiosk", "a page at the kiosk", "a page elsewhere")
    ]


def test_no_lane_waits_for_ever() -> None:
    queue: TurnQueue[Lane] = TurnQueue(100, 100)
    for lane, count in ((Lane.COMMAND, 40), (Lane.KIOSK, 40), (Lane.READ, 10)):
        for _ in range(count):
            queue.add("192.0.2.1", lane, lane)
    order = []
    while queue:
        following = queue.next_lane(reads=True)
        assert following is not None
        order.append(queue.take(following))
    assert len(order) == 90
    assert order[:4] == [Lane.COMMAND] * 4
    assert set(order[:15]) == set(Lane)


def test_reading_by_others_may_pause() -> None:
    queue: TurnQueue[str] = TurnQueue(3, 3)
    queue.add("192.0.2.1", Lane.READ, "a page")
    assert queue.next_lane(reads=False) is None
    assert queue
    assert queue.next_lane(reads=True) is Lane.READ


def test_clients_have_their_turns_however_much_each_asks() -> None:
    queue: TurnQueue[str] = TurnQueue(100, 100)
    for number in range(50):
        queue.add("192.0.2.1", Lane.READ, f"1-{number}")
    queue.add("192.0.2.2", Lane.READ, "2-0")
    queue.add("192.0.2.3", Lane.READ, "3-0")
    assert [queue.take(Lane.READ) for _ in range(4)] == ["1-0", "2-0", "3-0", "1-1"]


def test_a_client_that_waits_for_much_has_no_room_and_others_have() -> None:
    queue: TurnQueue[int] = TurnQueue(3, 5)
    for number in range(3):
        assert queue.has_room("192.0.2.1", Lane.READ)
        queue.add("192.0.2.1", Lane.READ, number)
        queue.add(KIOSK, Lane.KIOSK, number)
    assert not queue.has_room("192.0.2.1", Lane.READ)
    assert queue.has_room("192.0.2.1", Lane.COMMAND)
    assert queue.has_room("192.0.2.2", Lane.READ)
    assert queue.has_room(KIOSK, Lane.KIOSK)
