# Sourced by setup.sh and robot.sh: steps that are skipped where what they are made from has not changed.
# The caller sets: state (its folder), what (whose set-up it is), steps (all of them), only (those that are asked for, between commas);
# and has for each step NAME: key_NAME prints what it is made from, make_NAME does it, title_NAME is what it is called.
logs="$state/log"
started=$SECONDS

fail() { printf '\nalula setup: %s\n' "$1" >&2; [ -n "${2:-}" ] && printf '  to mend it: %s\n' "$2" >&2; exit 2; }

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }

digest() { cat "$@" 2>/dev/null | sha256sum | cut -c1-16; }
tree_digest() { # of all files below the given folders that decide what is built
  find -L "$@" -type f \( -name '*.msg' -o -name '*.srv' -o -name '*.action' -o -name CMakeLists.txt -o -name package.xml -o -name 'setup.*' \
    -o -name '*.cpp' -o -name '*.hpp' -o -path '*/scripts/*' \) -not -path '*/__pycache__/*' -print0 2>/dev/null | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c1-16
}

missing_of() { # PACKAGES...: those that dpkg does not have installed
  comm -23 <(printf '%s\n' "$@" | sort -u) \
    <(dpkg-query -W -f '${db:Status-Status} ${binary:Package}\n' 2>/dev/null | awk '$1=="installed"{sub(/:.*/,"",$2);print $2}' | sort)
}
check_rights() { # MISSING: Debian packages, to be installed
  local missing=$1
  [ -z "$missing" ] || [ "$(id -u)" = 0 ] || command -v sudo >/dev/null ||
    fail "Debian packages are missing ($(head -n 3 <<<"$missing" | paste -sd' ')...), and this is neither root nor is there sudo" "run this once as root: apt-get install --no-install-recommends $(paste -sd' ' <<<"$missing")"
}
install_packages() { # MISSING
  local name missing=$1
  [ -z "$missing" ] && return 0
  as_root apt-get update -q || return 1
  for name in $missing; do
    apt-cache show "$name" >/dev/null 2>&1 || { echo "alula: this system has no package '$name'; Debian 12 and 13 have it, and Ubuntu in 'universe'"; return 1; }
  done
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $missing
}

# beside ENV WORLD [LIST]: what given_ros.py says, in the environment that underlays.sh has printed into a file.
beside() {
  local place=$1; shift
  env -i PATH=/usr/bin:/bin "$BASH" -c '. "$1"; shift; exec python3 "$@"' beside "$place" "$ALULA_ROOT/setup/given_ros.py" "$@"
}

# The environment of a world; one that is there already, of the same Python and in the same place, gets the differences only.
# A virtual environment of the user's own must not leak into it.
clean() { env -u VIRTUAL_ENV -u PYTHONPATH -u PYTHONHOME "$@"; }
make_venv() { # FOLDER OPTIONS...
  local venv=$1; shift
  local version='import sys; print(sys.version)'
  grep -qsx "command = .* $venv" "$venv/pyvenv.cfg" &&
    [ "$(clean "$venv/bin/python3" -Sc "$version" 2>/dev/null)" = "$(/usr/bin/python3 -Sc "$version")" ] ||
    { rm -rf "$venv" && clean /usr/bin/python3 -m venv "$@" "$venv"; }
}

asked() { [[ ",$only," == *",$1,"* ]]; }
is_done() { [ "$(cat "$state/stamps/$1" 2>/dev/null)" = "$("key_$1")" ]; }

# run STEP: unless it is done, or --only leaves it out.
run() {
  local name=$1 log="$logs/$1.log" begun=$SECONDS key title
  asked "$name" && ! is_done "$name" || return 0
  title="title_$name"
  printf '  %-58s begins\n' "${!title}"
  rm -f "$state/stamps/$name"
  key=$("key_$name")
  if "make_$name" >"$log" 2>&1; then
    printf '  %-58s %3d s  done\n' "${!title}" $((SECONDS - begun))
    printf '%s' "$key" >"$state/stamps/$name"
  else
    local reason; reason=$(tac "$log" | grep -E '^(E: |ERROR|error:|[A-Za-z]+Error: |CMake Error|.*: error: |.*: error ALU[0-9]+: |alula: )' | head -n 1)
    fail "'${!title}' failed: ${reason:-see the log}" "the last lines of $log tell more; './alula setup' goes on where it stopped"
  fi
}

# together STEP...: runs steps that do not need one another side by side; the set-up ends when all have, if one has failed.
together() {
  local name worker workers=() failed=0
  set -m   # a process group each, which Ctrl-C ends
  for name in "$@"; do run "$name" & workers+=($!); done
  set +m
  trap 'kill -- "${workers[@]/#/-}" 2>/dev/null; exit 130' INT TERM
  for worker in "${workers[@]}"; do wait "$worker" || failed=1; done
  trap - INT TERM
  [ $failed = 0 ] || exit 2
}

# Ends the script where nothing is to be done: that needs no right to write. Else it returns as the only one who sets this up.
begin() {
  local name pending=0
  for name in $steps; do ! asked "$name" || is_done "$name" || { pending=1; break; }; done
  if [ $pending = 0 ]; then
    [ $quiet = 1 ] || echo "$what is ready"
    exit 0
  fi
  mkdir -p "$state/stamps" "$logs" 2>/dev/null && [ -w "$state/stamps" ] ||
    fail "$what: '$name' is to be made, and $state can't be written to" "check its owner, or let its owner run './alula setup'"
  exec 9>"$state/lock"
  command -v flock >/dev/null && { flock -n 9 || { echo "another setup of $what is running, waiting for it"; flock 9; }; }
  [ $quiet = 1 ] || echo "$what (logs: $logs)"
}
end() { [ $quiet = 1 ] || echo "$what is ready ($((SECONDS - started)) s)"; }
