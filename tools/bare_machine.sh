#!/usr/bin/env bash
# Runs the README's two commands as a newcomer does: on a system that has nothing but Python, venv, pip, git and
# make, from a clone of what is committed here.
#
#   tools/bare_machine.sh [SUITE] [COMMAND ...]
#
# SUITE: bookworm (Debian 12, the default), trixie (Debian 13), forky (Debian testing) or noble (Ubuntu 24.04).
# COMMANDs: "make report" and "make test" if none is given.
# BARE_MIRROR (Debian's, as debootstrap knows it): the archive to install from; Ubuntu's has to be given.
# BARE_DIR (/var/tmp/hicp-bare): where systems and logs are kept; a system is installed once and copied for each run.
#
# Exit codes: 0 all commands succeeded, 1 one of them failed, 2 it cannot be tried here.
set -euo pipefail

cannot() { echo "bare_machine: $*" >&2; exit 2; }

# A name space of its own: whatever ends this script, nothing stays mounted and nothing goes on running.
if [ "${BARE_APART:-}" != yes ]; then
  [ "$(id -u)" = 0 ] || cannot "needs root for chroot and mounts; run it as root"
  unshare --mount --pid --fork true 2>/dev/null || cannot "may not mount here; run it on a machine that allows it"
  BARE_APART=yes exec unshare --mount --pid --fork --kill-child "$0" "$@"
fi

suite=${1:-bookworm}; shift || true
[ $# -gt 0 ] || set -- "make report" "make test"
checkout=$(git -C "$(dirname "$0")" rev-parse --show-toplevel)
folder=${BARE_DIR:-/var/tmp/hicp-bare}
base=$folder/$suite.base root=$folder/$suite
mkdir -p "$folder"
exec 9>"$folder/$suite.lock"
flock -n 9 || cannot "another run of $suite is under way in $folder; wait for it to end"

install_base() {
  # debootstrap may be older than the suite: all suites of Debian, and all of Ubuntu, share one script.
  local scripts=/usr/share/debootstrap/scripts
  case $suite in
    bookworm | trixie | forky) set -- "$suite" "$base.partial" "${BARE_MIRROR:-}" $scripts/sid ;;
    noble)
      [ -n "${BARE_MIRROR:-}" ] || cannot "noble needs the address of an archive of Ubuntu's in BARE_MIRROR"
      set -- --components=main,universe "$suite" "$base.partial" "$BARE_MIRROR" $scripts/gutsy
      ;;
    *) cannot "suite is $suite; expected bookworm, trixie, forky or noble" ;;
  esac
  command -v debootstrap >/dev/null || { apt-get update -qq && apt-get install -qq -y debootstrap; } >/dev/null 2>&1 ||
    cannot "debootstrap is missing; run: apt-get install debootstrap"
  rm -rf --one-file-system "$base.partial"
  echo "bare_machine: installing $suite into $base ..."
  debootstrap --variant=minbase --include=python3,python3-venv,python3-pip,git,make,ca-certificates "$@" \
    >"$folder/$suite.base.log" 2>&1 ||
    cannot "debootstrap could not install $suite: $(tail -n 1 "$folder/$suite.base.log")"
  mv "$base.partial" "$base"
}

# What this machine needs to reach its package indexes: name server, certificates, apt's and pip's settings.
join_network() {
  cp -L /etc/resolv.conf "$root/etc/"
  rm -r "$root/etc/ssl/certs"
  cp -aL /etc/ssl/certs "$root/etc/ssl/"
  cp /etc/apt/apt.conf.d/* "$root/etc/apt/apt.conf.d/" 2>/dev/null || true
  local name PIP_INDEX_URL=${PIP_INDEX_URL:-$(python3 -m pip config get global.index-url 2>/dev/null)}
  for name in {http,https,no}_proxy {HTTP,HTTPS,NO}_PROXY SSL_CERT_FILE REQUESTS_CA_BUNDLE \
    PIP_CERT PIP_INDEX_URL PIP_TRUSTED_HOST PIP_DEFAULT_TIMEOUT; do
    [ -z "${!name:-}" ] || environment+=("$name=${!name}")
  done
}

[ -d "$base" ] || install_base
rm -rf --one-file-system "$root"
cp -a "$base" "$root"
environment=(HOME=/root LANG=C.UTF-8 PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin)
join_network
mount -t proc proc "$root/proc"
mount --bind /sys "$root/sys"  # MediaPipe's memory allocator reads it
mount --rbind /dev "$root/dev"
git clone -q "$checkout" "$root/root/project"

status=0 number=0
for command in "$@"; do
  number=$((number + 1)) begun=$SECONDS result=0
  log=$folder/$suite.$number.log
  chroot "$root" env -i "${environment[@]}" bash -c "cd /root/project && $command" </dev/null >"$log" 2>&1 || result=$?
  [ $result = 0 ] || { status=1; tail -n 25 "$log"; }
  echo "$suite: '$command' ended with $result after $((SECONDS - begun)) s; $log"
done
exit $status
