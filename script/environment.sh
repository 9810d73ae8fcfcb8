# Sourced by the scripts beside it: prepares the virtual environment .venv.
#
#   set_up [EXTRA...]   installs this package (editable) and these extras of setup.py into .venv,
#                       together with ROS 2 as wheels, unless the shell has a ROS 2 sourced.
#
# Variables: PYTHON      the interpreter (default: the one behind .venv, else python3)
#            ROS_WHEELS  the distribution of the wheels: jazzy (default) or kilted

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
VENV=$ROOT/.venv
ROS_WHEELS=${ROS_WHEELS:-jazzy}

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
    if [[ -n ${ROS_DISTRO:-} ]]; then
        [[ $ROS_DISTRO =~ ^(jazzy|kilted|lyrical|rolling)$ ]] ||
            fail "This shell has ROS 2 $ROS_DISTRO sourced, but this package needs Jazzy, Kilted," \
                'Lyrical or Rolling. Source one of them, or open a shell without any: then ROS is' \
                'installed as wheels.'
    else
        [[ $ROS_WHEELS =~ ^(jazzy|kilted)$ ]] ||
            fail "ROS_WHEELS is '$ROS_WHEELS': must be jazzy or kilted. Other distributions have to" \
                'be installed and sourced.'
    fi
}

# What .venv is built on: when any of it changes, .venv is made anew.
foundation() {
    "$PYTHON" -c 'import sys; print(sys.base_prefix, sys.version)'
    echo "$ROOT ${ROS_DISTRO:-wheels of $ROS_WHEELS}"
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

# The messages of a sourced ROS are compiled against the numpy that it comes with (1.26 for Jazzy and
# Kilted, 2 for Lyrical and Rolling): pip must keep that version.
constraints() {
    [[ -z ${ROS_DISTRO:-} ]] ||
        "$VENV/bin/python" -c 'import numpy; print(f"numpy=={numpy.__version__}")'
}

fail_install() {
    local log=$1 hints=(
        'Is there a network connection? pip needs a Python package index: https://pypi.org, or a'
        'mirror that PIP_INDEX_URL names; behind a proxy, set HTTPS_PROXY.')
    grep -q "No matching distribution found for ros-$ROS_WHEELS" "$log" && hints=(
        "There is no ROS wheel for this machine and '$PYTHON': they are made for Linux on x86_64"
        "and Python 3.10 to 3.13. Name such a Python (PYTHON=python3.12 $0)"
        'or install ROS 2 and source it.')
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

# Whether the package is still installed: pip may have removed it since.
is_installed() {
    [[ -x $VENV/bin/demo ]] && "$VENV/bin/python" -I -c 'import qflsd_ros' 2>/dev/null
}

# The extras to install, those of the ROS wheels included, separated by commas.
all_extras() {
    local extras=("$@")
    if [[ -z ${ROS_DISTRO:-} && $ROS_WHEELS == jazzy ]]; then
        extras+=(ros "${@/#/ros-}")
    elif [[ -z ${ROS_DISTRO:-} ]]; then
        extras+=("$ROS_WHEELS")
    fi
    (IFS=,; echo "${extras[*]}")
}

set_up() {
    choose_python
    check_ros
    local list stamp
    list=$(all_extras "$@")
    stamp=$VENV/installed-$list

    if ! { foundation | cmp -s - "$VENV/foundation" && "$VENV/bin/python" -c ''; } 2>/dev/null; then
        echo 'Making .venv ...' >&2
        make_venv
    fi
    if ! { cksum "$ROOT/setup.py" | cmp -s - "$stamp" && is_installed; }; then
        echo 'Installing the requirements into .venv (the first time: a minute or two) ...' >&2
        install_package "$list"
        cksum "$ROOT/setup.py" > "$stamp"
    fi
    [[ -n ${ROS_DISTRO:-} ]] || export AMENT_PREFIX_PATH=$VENV
}
