# What the parts of the checks share: each begins with `source tests/tools.sh`, at the top of the project. A part ends at the first command
# that fails, and the step it failed in is named; exit code 77 means that a program is missing, and which one was printed.
set -eEuo pipefail
form=${FLEXSPLINE_FORM:-long} # quick, changed or long
target=thumbv7em-none-eabihf
folder=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
programs=$folder/release
part=$(basename "$0")
out=$folder/checks/$part
mkdir -p "$out"
said=start
trap 'echo "failed: $part: $said (line $LINENO)"' ERR

say() { # STEP: what the next commands check
    said=$*
    printf '\n== %s\n' "$said"
}

refused() { # COMMAND...: must fail
    if "$@"; then return 1; fi
}

need() { # PROGRAM-OR-FILE PACKAGE...: present, or installed through apt where that is possible
    local wanted package
    while (($#)); do
        wanted=$1 package=$2
        shift 2
        if command -v "$wanted" > /dev/null || [[ -f $wanted ]]; then continue; fi
        # One at a time: parts run next to each other, and apt has one lock.
        if command -v apt-get > /dev/null && ((EUID == 0)); then
            flock "$folder" sh -c "apt-get install -y $package || { apt-get update && apt-get install -y $package; }" > /dev/null 2>&1 || true
        fi
        if command -v "$wanted" > /dev/null || [[ -f $wanted ]]; then continue; fi
        echo "left out: $wanted is missing; install the package $package"
        exit 77
    done
}

python_environment() { # FOLDER PACKAGE...: an environment with these packages of PyPI, made anew where it has others
    if [[ -f $1/packages && $(< "$1/packages") == "${*:2}" ]]; then return; fi
    rm -rf "$1"
    python3 -m venv "$1"
    "$1/bin/pip" install -q --no-compile --disable-pip-version-check "${@:2}"
    printf '%s\n' "${*:2}" > "$1/packages"
}

tables() { # FOLDER GENERATOR...: made of the samples that contact FEM computed
    local generator
    for generator in "${@:2}"; do
        "$programs/flexspline" tables -q --no-report --generator "$generator" --out "$1" --from-samples "tests/firmware/samples/$generator.samples.csv"
    done
}

emulate() { # ELF: its output, with an exact count of instructions
    qemu-system-arm -cpu cortex-m4 -machine mps2-an386 -nographic -icount shift=10,sleep=off \
        -semihosting-config enable=on,target=native -kernel "$1"
}

within() { # NAME VALUE: no more than tests/firmware/budget has under this name
    local most
    most=$(awk -v name="$1" '$1 == name { print $2 }' tests/firmware/budget)
    printf '%s: %s, at most %s\n' "$1" "${2:-nothing}" "${most:-nothing}"
    [[ -n ${2:-} && -n $most ]]
    (($2 <= most))
}

page() { # PAGE MARK: the commands of its blocks `sh MARK`, as they stand there; the program is there already
    mkdir -p "$out/bin"
    printf '%s\n' '#!/bin/sh' "[ \"\$1 \$2 \$3\" = 'run --release --' ] || exec $(command -v cargo) \"\$@\"" 'shift 3' \
        "exec $programs/flexspline \"\$@\"" > "$out/bin/cargo"
    chmod +x "$out/bin/cargo"
    awk -v fence="\`\`\`sh $2" '$0 == fence { on = 1; next } /^```/ { if (on) print ""; on = 0 } on' "$1" > "$out/page.sh"
    [[ -s $out/page.sh ]]
    PATH=$out/bin:$PATH bash -e "$out/page.sh"
}
