"""The table of what clients may ask for in docs/reference/http.md, made from the table of limits."""

from app.cell.permission.client_limits import PLACE_LIMITS, RATE_LIMITS, PlaceLimit, RateLimit
from app.web.turns import KIOSK_WAITING_MOST, WAITING_MOST


def limits_table() -> str:
    rows = [
        ("what", "limit", "more than that"),
        ("---",) * 3,
        *(_rate(limit) for limit in RATE_LIMITS.values()),
        (
            "requests of one client that wait for their turn",
            f"{WAITING_MOST}; of the kiosk's own machine {KIOSK_WAITING_MOST}",
            "429 with `Retry-After: 1`, half a second later",
        ),
        *(_place(limit) for limit in PLACE_LIMITS.values()),
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _rate(limit: RateLimit) -> tuple[str, str, str]:
    rate = f"{limit.quota.per_s:g} a second, {limit.quota.burst:g} at once"
    later = ", half a second later" if limit.sentence == "too_many_requests" else ""
    return limit.about, rate, f"429 with `Retry-After: {limit.retry_after_s}`{later}"


def _place(limit: PlaceLimit) -> tuple[str, str, str]:
    places = limit.places
    shares = (
        f"{places.total}: {places.client} of one other machine, {places.others} of all of them, "
        f"{places.kiosk} of the kiosk's own"
    )
    return limit.about, shares, limit.refused
