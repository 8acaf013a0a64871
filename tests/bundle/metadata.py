"""What build systems read of a bundle, checked by their own code as far as it comes from PyPI: metadata.py BUNDLE

PlatformIO: its schema of library.json, with the list of licences that it would load from the network cut down to two.
Zephyr: Kconfig by kconfiglib, the parser it uses; module.yml by the keys of its scripts/schemas/module-schema.yaml.
Arduino: library.properties by the fields that its library specification asks for.
"""

import json
import os
import re
import sys
import tempfile

import kconfiglib
import yaml
from platformio.package.manifest.parser import ManifestParserFactory
from platformio.package.manifest.schema import ManifestSchema

bundle = sys.argv[1]


def text(path):
    with open(os.path.join(bundle, path), encoding="utf-8") as file:
        return file.read()


def platformio():
    licences = {"licenses": [{"licenseId": "MIT"}, {"licenseId": "Apache-2.0"}]}
    ManifestSchema.load_spdx_licenses = staticmethod(lambda: licences)
    for name in ("library.json", "library.properties"):
        found = ManifestSchema().load_manifest(ManifestParserFactory.new_from_file(os.path.join(bundle, name)).as_dict())
        assert found["name"] == "flexspline", found
    build = json.loads(text("library.json"))["build"]
    assert "-ffp-contract=off" in build["flags"] and os.path.isdir(os.path.join(bundle, build["includeDir"]))


def target(*symbols):
    """The static library that Zephyr takes for a processor with these symbols."""
    known = "CPU_CORTEX_M0 CPU_CORTEX_M0PLUS CPU_CORTEX_M3 CPU_CORTEX_M4 CPU_CORTEX_M7 CPU_CORTEX_M33 FPU FP_HARDABI RISCV 64BIT".split()
    assert set(symbols) <= set(known)
    with tempfile.NamedTemporaryFile("w", suffix="Kconfig") as top:
        for name in known:
            top.write(f"config {name}\n\tbool\n" + ("\tdefault y\n" if name in symbols else ""))
        top.write(f'source "{os.path.abspath(bundle)}/zephyr/Kconfig"\n')
        top.flush()
        os.environ["KCONFIG_WARN_UNDEF"] = "y"
        parsed = kconfiglib.Kconfig(top.name, warn_to_stderr=False)
    assert not parsed.warnings, parsed.warnings
    parsed.syms["FLEXSPLINE_CORE"].set_value("y")
    return parsed.syms["FLEXSPLINE_TARGET"].str_value


def zephyr():
    assert target("CPU_CORTEX_M0PLUS") == "thumbv6m-none-eabi"
    assert target("CPU_CORTEX_M3") == "thumbv7m-none-eabi"
    assert target("CPU_CORTEX_M4") == "thumbv7em-none-eabi"
    assert target("CPU_CORTEX_M4", "FPU") == "thumbv7em-none-eabi"
    assert target("CPU_CORTEX_M7", "FPU", "FP_HARDABI") == "thumbv7em-none-eabihf"
    assert target("CPU_CORTEX_M33", "FPU", "FP_HARDABI") == "thumbv8m.main-none-eabihf"
    assert target("CPU_CORTEX_M33") == ""
    assert target("RISCV") == "riscv32imac-unknown-none-elf"
    assert target("RISCV", "64BIT") == "riscv64gc-unknown-none-elf"
    module = yaml.safe_load(text("zephyr/module.yml"))
    assert set(module) == {"name", "build"} and set(module["build"]) == {"cmake", "kconfig"}, module
    assert os.path.isfile(os.path.join(bundle, module["build"]["cmake"], "CMakeLists.txt"))
    assert os.path.isfile(os.path.join(bundle, module["build"]["kconfig"]))
    for path in re.findall(r"\$\{flexspline_folder\}/([\w./-]+\.c)", text("zephyr/CMakeLists.txt")):
        assert os.path.isfile(os.path.join(bundle, path)), path


def arduino():
    fields = dict(line.split("=", 1) for line in text("library.properties").splitlines() if line)
    needed = {"name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url", "architectures"}
    assert needed <= set(fields) and all(fields.values()), fields
    assert re.fullmatch(r"\d+\.\d+\.\d+", fields["version"])
    assert fields["category"] in ("Display", "Communication", "Signal Input/Output", "Sensors", "Device Control", "Timing",
                                  "Data Storage", "Data Processing", "Other")
    assert os.path.isfile(os.path.join(bundle, "src", fields["includes"]))


platformio()
zephyr()
arduino()
print("library.json, library.properties, zephyr/: as their build systems want them")
