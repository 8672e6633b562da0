#!/usr/bin/env bash
# Runs a command on the newest Python of Debian's testing, in a root of its own: tools/newest_python.sh -m pytest ...
#
# Makes the root in build/newest-python where it is missing (10 s, 110 MB), and installs UAL with its tools for development
# in the versions of constraints.txt (10 s), but gRPC in its newest. Needs the rights of root, and mmdebstrap. Nothing outside of the root changes.
set -euo pipefail
here=$(cd "$(dirname "$0")/.." && pwd)
root=$here/build/newest-python

if [[ ! -e $root.made ]]; then
    mkdir -p "$here/build"
    rm -rf "$root"
    # Packages are unpacked, not configured: a Python needs no more, and it takes a tenth of the time. An archive's copy
    # may be older than its own date of expiry; its signature is checked all the same.
    mmdebstrap --variant=extract --hook-dir=/usr/share/mmdebstrap/hooks/merged-usr \
        --aptopt='Acquire::Check-Valid-Until "false"' \
        --include=python3,python3-venv,ca-certificates,openssl,coreutils,bash,libstdc++6 \
        testing "$root" http://deb.debian.org/debian >"$root.log" 2>&1 || { tail -n 20 "$root.log"; exit 1; }
    touch "$root.made"
fi

# What is mounted is seen by this command only, and goes with it.
exec unshare --mount bash -euo pipefail -s -- "$root" "$here" "$@" <<'INSIDE'
root=$1 here=$2
shift 2
wheels=${PIP_FIND_LINKS:-}
for each in "$here" /dev /sys /tmp /proc ${wheels:+"$wheels"}; do
    [[ -d $each ]] || continue
    mkdir -p "$root$each"
    mount --rbind "$each" "$root$each"
done
for each in /etc/resolv.conf /etc/hosts /etc/passwd /etc/group /etc/ssl/certs/ca-certificates.crt; do
    mkdir -p "$root${each%/*}"
    cp "$each" "$root$each"
done
exec chroot "$root" bash -euo pipefail -c '
    cd "$1"
    shift
    if [[ constraints.txt -nt /venv/.installed || pyproject.toml -nt /venv/.installed ]]; then
        python3 -m venv --without-pip /venv
        build/uv/bin/uv pip install --quiet --python /venv/bin/python --constraint constraints.txt \
            -e clients/python -e clients/python/ual_tools -e ".[dev]"
        # As `make test-newest-grpc` has them.
        build/uv/bin/uv pip install --quiet --python /venv/bin/python --no-deps --upgrade \
            grpcio grpcio-status grpcio-health-checking grpcio-reflection "protobuf<8"
        touch /venv/.installed
    fi
    exec /venv/bin/python "$@"
' newest_python "$here" "$@" </dev/null
INSIDE
