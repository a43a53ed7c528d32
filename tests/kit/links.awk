# links.awk - which objects each unit test is linked with, as rules for make, and which of them try
# more in make check; see tests/build.mk
function name_of(path) {
    sub(/.*\//, "", path)
    return path
}
# all that file includes, and what these do, marked in seen
function follow(file, i, n, names) {
    n = split(includes[file], names, " ")
    for (i = 1; i <= n; i++) {
        if (names[i] in seen) continue
        seen[names[i]] = 1
        follow(names[i])
    }
}
FNR == 1 { file = name_of(FILENAME) }
/^#include "/ { split($0, word, "\""); includes[file] = includes[file] " " name_of(word[2]) }
/tk_(sweep|sweep_outputs|sweep_thinned|places|full|wide)\(/ { sweeps[file] = 1 }
/^#define [A-Z_]*_IMPLEMENTATION/ {
    sub(/_IMPLEMENTATION.*/, "", $2)
    holds[file, tolower($2)] = 1
}
END {
    module_count = split(modules, module, " ")
    for (file in includes) {
        if (file !~ /^test_.*\.c$/) continue
        split("", seen)
        follow(file)
        objects = ""
        for (i = 1; i <= module_count; i++)
            if ((module[i] ".h") in seen && !((file, module[i]) in holds))
                objects = objects " " root "/modules/" module[i] ".o"
        if ("image_io.h" in seen || "mesh_io.h" in seen || "mesh_file.h" in seen) objects = objects " " files
        more = file in sweeps
        for (name in seen) more = more || (name in sweeps && name !~ /^(faults|testkit)\.h$/)
        if (more) sweeping = sweeping " " substr(file, 1, length(file) - 2)
        print root "/unit/" substr(file, 1, length(file) - 2) ":" objects
    }
    print "SWEEPING =" sweeping
}
