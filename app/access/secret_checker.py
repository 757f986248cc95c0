"""Hashes secrets beside the event loop, on one thread for the kiosk's own machine and one for all
others, at a low priority: a flood of sign-ins delays neither a press nor a sign-in at the cell."""

import asyncio
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import Final, TypeVar

from app.access.secrets_hash import Cost, Way, badge_hash, hashed, matches
from app.access.users import User, UserBook
from app.errors import TooMany
from app.i18n import say
from app.rate_limit import Quota, TokenBuckets

NICE: Final = 10
MOST_WAITING: Final = 4
OTHERS_QUOTA: Final = Quota(10, per_s=1)  # sign-ins from all other machines together
AGAIN_S: Final = 2

Result = TypeVar("Result")


class SecretChecker:
    """Used on the event loop only."""

    def __init__(self, cost: Cost, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.cost = cost
        self._others = TokenBuckets(OTHERS_QUOTA, monotonic)
        self._waiting = {True: 0, False: 0}
        self._threads = {
            local: ThreadPoolExecutor(1, f"sign-in-{name}", _be_nice)
            for local, name in ((True, "here"), (False, "elsewhere"))
        }
        self._nothing = hashed("", cost)  # for users that do not exist

    def admit(self, local: bool) -> None:
        """TooMany if more sign-ins are under way than may be."""
        if self._waiting[local] >= MOST_WAITING or not (local or self._others.has_token("")):
            raise TooMany(say("sign_in_busy"), AGAIN_S)
        if not local:
            self._others.take_token("")

    async def user_of(
        self, book: UserBook, name: str, way: Way, secret: str, local: bool
    ) -> User | None:
        """The user who has this secret, by their name or by their badge alone; None if nobody has. It
        takes the same time for a user who does not exist."""
        if way == "badge" and not name:
            badge = await self._run(local, partial(badge_hash, secret, book.badge_salt))
            user = book.user_of_badge(badge)
            return user if user and not user.disabled else None
        user = book.user(name)
        if way == "badge":
            same = await self._run(local, partial(badge_hash, secret, book.badge_salt))
            correct = bool(user and user.badge) and same == (user.badge if user else "")
        else:
            known = user.hash_of(way) if user else ""
            checked = await self._run(local, partial(matches, known or self._nothing, secret))
            correct = checked and bool(known)
        return user if user and correct and not user.disabled else None

    async def hashed(self, secret: str) -> str:
        """The hash of a new PIN or password."""
        return await self._run(True, partial(hashed, secret, self.cost))

    def close(self) -> None:
        for thread in self._threads.values():
            thread.shutdown(wait=False, cancel_futures=True)

    async def _run(self, local: bool, work: Callable[[], Result]) -> Result:
        self._waiting[local] += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._threads[local], work)
        finally:
            self._waiting[local] -= 1


def _be_nice() -> None:
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)
