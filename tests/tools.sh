# What the parts of the checks share: each begins with `source tests/tools.sh`, at the top of the project. A part ends at the first command
# that fails, and names it; with exit code 77 where a program is missing, which it names.
# shellcheck disable=SC2034 # Names that parts use.
set -eEuo pipefail
form=${FLEXSPLINE_FORM:-long} # quick, changed or long
folder=$(realpath -m "${CARGO_TARGET_DIR:-target}") programs=$folder/release
out=$folder/checks/$(basename "$0")
target=thumbv7em-none-eabihf
cortex=(arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard -ffreestanding)
reader=$PWD/core/c99/flexspline_table.c broken=$out/broken.c
mkdir -p "$out"
trap 'echo "failed: ${BASH_SOURCE[0]}:$LINENO: $BASH_COMMAND" >&2' ERR

refused() { ! "$@"; }
need() { # PROGRAM-OR-FILE[:PACKAGE]...: present, or installed by apt where that is possible
    for of in "$@"; do
        # One at a time: parts run next to each other, and apt has one lock.
        command -v "${of%:*}" > /dev/null || [[ -f ${of%:*} ]] || flock "$folder" sh -c "apt-get install -y ${of#*:} || { apt-get update && apt-get install -y ${of#*:}; }" \
            > /dev/null 2>&1 || { echo "left out: ${of%:*} is missing; install the package ${of#*:}" && exit 77; }
    done
}
python_environment() { # FOLDER PACKAGE...: an environment with these packages of PyPI, or those of -r FILE
    [[ -x $1/bin/pip ]] || python3 -m venv "$1"
    "$1/bin/pip" install -q --no-compile --disable-pip-version-check "${@:2}"
}
tables() { # FOLDER: those of the four generators, made of samples that contact FEM computed
    for of in cam double-disc four-roller two-roller; do
        "$programs/flexspline" tables -q --no-report --generator $of --out "$1" --from-samples tests/firmware/samples/$of.samples.csv
    done
}
plant() { # SED: makes $broken of the reader in C99, with one bug
    sed "$1" "$reader" > "$broken"
    refused cmp -s "$broken" "$reader"
}
emulate() { # ELF: its output, with an exact count of instructions
    qemu-system-arm -cpu cortex-m4 -machine mps2-an386 -nographic -icount shift=10,sleep=off \
        -semihosting-config enable=on,target=native -kernel "$1"
}
emulate_c() { # ARGUMENTS OF GCC...: builds a program in C for the Cortex-M4F and runs it
    "${cortex[@]}" -nostdlib -Wl,--gc-sections -z noexecstack -L. -T tests/firmware/c/{link.ld,startup.c} "$@" -lgcc -o "$out/elf"
    emulate "$out/elf"
}
size() { arm-none-eabi-size "$1" | awk -v column="$2" 'END { print $column }'; } # ELF COLUMN
within() { # NAME...: the largest number after each in $out/figures is no more than tests/firmware/budget has
    for name in "$@"; do
        awk -v name="$name" 'NR == FNR { if ($1 == name) most = $2; next }
            { for (i = 1; i < NF; i++) if ($i == name ":" && $(i + 1) > found) found = $(i + 1) }
            END { print name ": " found ", at most " most; exit !(found && most && found <= most) }' tests/firmware/budget "$out/figures"
    done
}
page() { # PAGE MARK: the commands of its blocks `sh MARK`, as they stand there; the program is there already
    cargo() { if [[ ${*:1:3} == "run --release --" ]]; then "$programs/flexspline" "${@:4}"; else command cargo "$@"; fi; }
    awk -v fence="\`\`\`sh $2" '$0 == fence { on = 1; next } /^```/ { on = 0 } on' "$1" > "$out/page.sh"
    [[ -s $out/page.sh ]]
    (export programs && export -f cargo && bash -e "$out/page.sh")
    unset -f cargo
}
