#!/bin/sh
# What the tests need besides Python and git: installed on Debian as root, named elsewhere.
# `system.sh browser`: for `make test`. `system.sh`: for all tests, which need Rust and namespaces too.
# `system.sh PACKAGE` looks for that one alone. With INSTALL=no the packages are named only.
set -eu
FONTS=/usr/share/fonts/truetype
RUST=1.89 # of what tests/Cargo.lock has
only=${1:-}

missing=""
need() { # need PACKAGE COMMAND…: the package, unless the command succeeds
    package=$1
    shift
    [ -z "$only" ] || [ "$only" = browser ] || [ "$only" = "$package" ] || return 0
    "$@" >/dev/null 2>&1 || missing="$missing $package"
}

has_libclang() { # libclang-cpp is another library
    ls -d /usr/lib/llvm-*/lib/* /usr/lib/*/* /usr/lib*/* 2>/dev/null | grep -Eq '/libclang(-[0-9.]+)?\.so'
}

has_postgresql() {
    ls /usr/lib/postgresql/*/bin/initdb | grep -q .
}

has_faketime() {
    ls /usr/lib/*/faketime/libfaketimeMT.so.1 | grep -q .
}

need chromium chromium --version
need chromium-headless-shell test -e /usr/bin/chromium-headless-shell
# Pages are laid out with each of these alone, see tests/support/browser/fonts.py.
need fonts-dejavu-core test -e "$FONTS/dejavu/DejaVuSans.ttf"
need fonts-noto-core test -e "$FONTS/noto/NotoSans-Regular.ttf"
need fonts-noto-cjk test -e "${FONTS%/*}/opentype/noto/NotoSansCJK-Regular.ttc"
need python3-venv "${PYTHON:-python3}" -c "import ensurepip"
if [ "${1:-}" != browser ]; then
    need build-essential cc --version
    need cmake cmake --version
    need firefox-esr firefox-esr --version
    need webkit2gtk-driver test -e /usr/bin/WebKitWebDriver
    need xvfb test -e /usr/bin/Xvfb
    need libclang-dev has_libclang
    need faketime has_faketime
    # The kiosk's compositor, what takes its picture, types into it and reports idleness.
    need sway sway --version
    need grim test -e /usr/bin/grim
    need wtype test -e /usr/bin/wtype
    need swayidle test -e /usr/bin/swayidle
    need mosquitto test -e /usr/sbin/mosquitto
    need postgresql has_postgresql
    need minisign minisign -v
    need nginx test -e /usr/sbin/nginx
    need caddy caddy version
    need systemd systemd-analyze --version
    need iproute2 ip -V
    need util-linux nsenter --version
    need curl curl --version
    need sqlite3 sqlite3 --version
fi
[ "$only" != npm ] || need npm npm --version # for `make check` and the benchmark's rivals
if [ -z "${1:-}" ]; then
    command -v cargo >/dev/null || { echo "missing: Rust $RUST or later (cargo)" >&2; exit 1; }
    has=$(cargo --version | cut -d" " -f2)
    [ "$(printf '%s\n' "$RUST" "$has" | sort -V | head -n 1)" = "$RUST" ] || {
        echo "the bridge of the tests needs Rust $RUST or later; this cargo is $has (rustup installs a newer one)" >&2
        exit 1
    }
    unshare --mount --net true 2>/dev/null || {
        echo "the tests make mount and network namespaces, which is not allowed here:" \
            "run them as root (in a container: with CAP_SYS_ADMIN), or by \`unshare -rmn make test\`" >&2
        exit 1
    }
    unshare --user --map-user=1000 --map-group=1000 true 2>/dev/null || {
        echo "the kiosk's tests run its compositor in a user namespace, which is not allowed here:" \
            "allow them (sysctl user.max_user_namespaces, kernel.unprivileged_userns_clone or" \
            "kernel.apparmor_restrict_unprivileged_userns)" >&2
        exit 1
    }
fi

[ -n "$missing" ] || exit 0
if [ "${INSTALL:-}" = no ]; then
    echo "missing, by Debian's names:$missing. \`make system\` installs them on Debian as root" >&2
    exit 1
elif [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "installing$missing (once, by apt-get)"
    # What apt-get says is of interest only where it fails: debconf complains on every small system.
    said=$(mktemp)
    trap 'rm -f "$said"' EXIT
    # shellcheck disable=SC2086  # a list of packages
    { apt-get update -qq &&
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing; } >"$said" 2>&1 || {
        cat "$said" >&2
        echo "apt-get could not install$missing: install that, then run this again" >&2
        exit 1
    }
else
    echo "missing, by Debian's names:$missing. Install that, then run this again:" >&2
    echo "sudo apt-get install --no-install-recommends$missing" >&2
    exit 1
fi
