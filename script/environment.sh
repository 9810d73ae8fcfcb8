# Sourced by the scripts beside it: makes .venv ready, whatever the machine has.
#
#   set_up [EXTRA...]   .venv then holds this package (editable) with these extras of setup.py, and
#                       ROS 2 Jazzy: the sourced one, else the wheels.
#
# The variable PYTHON names the interpreter (default: the one behind .venv, else python3).

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
VENV=$ROOT/.venv

fail() {
    printf '%s\n' "$@" >&2
    exit 1
}

choose_python() {
    local version known
    known=$(cat "$VENV/interpreter" 2>/dev/null || true)
    [[ -x $known ]] || known=python3
    PYTHON=${PYTHON:-$known}
    version=$("$PYTHON" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])' 2>/dev/null) ||
        fail "There is no Python called '$PYTHON'. Install Python 3.10 or newer" \
            '(Ubuntu, Debian: sudo apt install python3 python3-venv),' \
            "or say where one is: PYTHON=/path/to/python3 $0"
    "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 10))' ||
        fail "'$PYTHON' is Python $version, but 3.10 or newer is needed." \
            "Is there a newer one? Name it: PYTHON=python3.12 $0" \
            'If not, install one (Ubuntu, Debian: sudo apt install python3 python3-venv).'
}

check_ros() {
    [[ ${ROS_DISTRO:-jazzy} == jazzy ]] ||
        fail "This shell has ROS 2 $ROS_DISTRO sourced, but this package is made for Jazzy." \
            'Source that one, or open a shell without any: then ROS is installed as wheels.'
}

# What .venv is built on: when any of it changes, .venv is made anew.
foundation() {
    "$PYTHON" -c 'import sys; print(sys.base_prefix, sys.version)'
    echo "$ROOT ${ROS_DISTRO:-wheels}"
}

make_venv() {
    local options=(--clear) said
    [[ -z ${ROS_DISTRO:-} ]] || options+=(--system-site-packages)
    if ! said=$("$PYTHON" -m venv "${options[@]}" "$VENV" 2>&1); then
        rm -rf "$VENV"
        "$PYTHON" -c 'import ensurepip, venv' 2>/dev/null ||
            fail "'$PYTHON' cannot make a virtual environment: it lacks the modules venv and" \
                'ensurepip (Ubuntu, Debian: sudo apt install python3-venv).'
        fail "'$PYTHON -m venv $VENV' failed:" "$said"
    fi
    "$PYTHON" -c 'import sys; print(sys._base_executable)' > "$VENV/interpreter"
    foundation > "$VENV/foundation"
}

# The messages of a sourced ROS are compiled against its own numpy: no other one may slip in.
constraints() {
    [[ -z ${ROS_DISTRO:-} ]] ||
        "$VENV/bin/python" -c 'import numpy; print(f"numpy=={numpy.__version__}")'
}

fail_install() {
    local log=$1 hints=(
        'Is there a network connection? pip needs a Python package index: https://pypi.org, or a'
        'mirror that PIP_INDEX_URL names; behind a proxy, set HTTPS_PROXY.')
    grep -q 'No matching distribution found for ros-jazzy' "$log" && hints=(
        "There is no ROS wheel for this machine and '$PYTHON': they are made for Linux on x86_64"
        "and Python 3.10 to 3.13. Name such a Python (PYTHON=python3.12 $0)"
        'or install ROS 2 Jazzy and source it.')
    fail 'Installing what this package needs failed:' "$(grep -m 2 'ERROR:' "$log" | sed 's/^ *//')" \
        "${hints[@]}" "Everything that pip said: $log"
}

install_package() {
    local extras=$1 log=$VENV/install.log
    constraints > "$VENV/constraints.txt"
    "$VENV/bin/python" -m pip install --retries 2 --disable-pip-version-check \
        --constraint "$VENV/constraints.txt" --editable "$ROOT${extras:+[$extras]}" \
        > "$log" 2>&1 || fail_install "$log"
}

# What pip was once told may be undone since.
is_installed() {
    [[ -x $VENV/bin/demo ]] && "$VENV/bin/python" -I -c 'import qflsd_ros' 2>/dev/null
}

set_up() {
    choose_python
    check_ros
    local extras=("$@")
    [[ -n ${ROS_DISTRO:-} ]] || extras+=(ros "${@/#/ros-}")
    local list
    list=$(IFS=,; echo "${extras[*]}")
    local stamp=$VENV/installed-$list

    if ! { foundation | cmp -s - "$VENV/foundation" && "$VENV/bin/python" -c ''; } 2>/dev/null; then
        echo 'Making .venv ...' >&2
        make_venv
    fi
    if ! { cksum "$ROOT/setup.py" | cmp -s - "$stamp" && is_installed; }; then
        echo 'Installing into .venv what this package needs (the first time: a minute or two) ...' >&2
        install_package "$list"
        cksum "$ROOT/setup.py" > "$stamp"
    fi
    [[ -n ${ROS_DISTRO:-} ]] || export AMENT_PREFIX_PATH=$VENV
}
