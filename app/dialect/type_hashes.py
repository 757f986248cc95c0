"""The type hashes of a distribution of ROS 2, as key expressions have them. Pure."""

from typing import Final

from app.dialect.dialect import ANY_HASH, TypeHash
from app.errors import InterfaceError
from app.interfaces import Interfaces

NO_HASH: Final = "TypeHashNotSupported"  # what ROS 2 before iron has in its place
WITHOUT_HASHES: Final = frozenset({"humble"})


def distribution_hashes(distro: str, interfaces: Interfaces) -> TypeHash:
    """The hashes of the nodes of a distribution: of its definitions, and of the panel's own."""

    def key_hash(type_name: str) -> str:
        if distro in WITHOUT_HASHES:
            return NO_HASH
        try:
            return interfaces.type_hash(type_name)
        except InterfaceError:
            return ANY_HASH

    return key_hash
