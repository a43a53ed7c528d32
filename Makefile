# texkit - `make` builds build/texkit; `make help` lists the rest

CC      ?= cc
CXX     ?= c++
CFLAGS  ?= -O3
PREFIX  ?= /usr/local
BUILD   ?= build

VERSION := $(shell sed -n 's/^.define TEXKIT_VERSION "\(.*\)"/\1/p' tools/cli.h)
OPENMP  := $(shell echo 'int main(void) { return 0; }' | \
             $(CC) -fopenmp -xc - -o /dev/null 2>/dev/null && echo -fopenmp)
WARN    := -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow

# -ffp-contract=off: the same bytes on machines with and without fused multiply-add
COMPILE  = $(CC) -std=c99 $(CFLAGS) -ffp-contract=off $(OPENMP) $(WARN) -Isrc -Itools $(FORMATS) $(CPPFLAGS)
LINK     = $(CC) $(CFLAGS) $(OPENMP) $(LDFLAGS)

SOURCES := $(wildcard src/*.h src/*/*.h)
HEADERS := $(notdir $(wildcard src/*.h))
TEXKIT   = $(patsubst tools/%.c,$(BUILD)/%.o,\
             $(wildcard tools/*.c tools/modules/*.c tools/commands/*.c tools/files/*.c))
IMAGES   = $(patsubst tools/%.c,$(BUILD)/%.o,$(wildcard tools/files/image_*.c) tools/files/stb.c)
TIMED    = $(BUILD)/env.o $(IMAGES)
MESHES   = $(patsubst tools/%.c,$(BUILD)/%.o,$(wildcard tools/files/mesh*.c))
# The libraries of image formats; TIFF and WebP are left out where theirs is not installed. They are looked
# for when the first recipe wants them, which is behind the set-up, and once
find_library = $(shell printf '\043include <%s>\nint main(void) { return 0; }\n' $(1) | \
                 $(CC) -xc - -o /dev/null $(2) 2>/dev/null && echo $(2))
TIFF     = $(eval TIFF := $$(call find_library,tiffio.h,-ltiff))$(TIFF)
WEBP     = $(eval WEBP := $$(call find_library,webp/encode.h,-lwebp))$(WEBP)
FORMATS  = $(if $(TIFF),-DTEXKIT_TIFF) $(if $(WEBP),-DTEXKIT_WEBP)
PICTURES = -lpng -lz -ljpeg $(TIFF) $(WEBP)
# examples/brush opens a window, which takes SDL 2; examples/forest_gl takes OpenGL, and opens a
# window if it can. Where that is not installed they are left out
SDL     := $(shell sdl2-config --libs 2>/dev/null)
GL      := $(shell printf '\043include <%s>\n' EGL/egl.h EGL/eglext.h GL/gl.h GL/glext.h | \
             sed '$$aint main(void) { return 0; }' | \
             $(CC) -xc - -o /dev/null -lEGL -lOpenGL 2>/dev/null && echo -lEGL -lOpenGL)
LEFT_OUT = $(if $(SDL),,brush) $(if $(GL),,forest_gl)
EXAMPLES = $(addprefix $(BUILD)/examples/,$(filter-out $(LEFT_OUT), \
             $(patsubst examples/%.c,%,$(wildcard examples/*.c)) \
             $(patsubst examples/%/main.c,%,$(wildcard examples/*/main.c))))
BENCHES  = $(patsubst bench/%.c,$(BUILD)/bench/%,$(wildcard bench/*.c))
PLAIN    = $(patsubst bench/%.c,$(BUILD)/bench/plain/%,$(wildcard bench/*.c))

.PHONY: all help headers demo test check test-run check-run test-list check-list golden examples bench lint install uninstall clean setup samples helpers
.DELETE_ON_ERROR:

all: $(BUILD)/texkit

help:
	@echo "make            build $(BUILD)/texkit, the command line tool"
	@echo "make headers    paste the headers at the root together from src/"
	@echo "make demo       texture, tiles, meshes, trees from sample photographs, write out/index.html"
	@echo "make test       the tests, with the sanitizers on: minutes, less where little has changed"
	@echo "make check      all tests: compilers, the tool under sanitizers, pictures, OpenGL, fuzzing"
	@echo "make examples   build the programs of examples/ into $(BUILD)/examples/"
	@echo "make bench      print a table of timings"
	@echo "make lint       cppcheck and clang-tidy"
	@echo "make install    headers, shaders, pkg-config file and tool; PREFIX=$(PREFIX), DESTDIR="
	@echo "make uninstall  take them away again"
	@echo "make clean      remove $(BUILD)/ and out/"

# ---- the headers at the root

headers:
	@tools/headers.sh

# ---- the tool and its helpers

setup:
	@CC="$(CC)" tools/setup.sh tool

# the compiler notes in a .d file which headers an object stands on
$(BUILD)/%.o: tools/%.c Makefile | setup
	@mkdir -p $(@D)
	$(COMPILE) -MMD -MP -c $< -o $@
-include $(wildcard $(BUILD)/*.d $(addprefix $(BUILD)/,modules/*.d commands/*.d files/*.d helpers/*.d))

# stb shifts into the sign bit on purpose; that is not what our sanitizer runs look for
$(BUILD)/files/stb.o: COMPILE += -fno-sanitize=undefined

$(BUILD)/texkit: $(TEXKIT)
	$(LINK) $^ -o $@ -lcjson $(PICTURES) -lm
	@echo $(PICTURES) >$(BUILD)/files/libraries # for programs of the tests

# small programs that the demo, the tests and the benchmark use
helpers: $(BUILD)/crop $(BUILD)/draw $(BUILD)/scan $(BUILD)/shape $(BUILD)/view

$(BUILD)/crop $(BUILD)/draw $(BUILD)/scan: $(BUILD)/%: $(BUILD)/helpers/%.o $(IMAGES)
	$(LINK) $^ -o $@ $(PICTURES) -lm

$(BUILD)/shape: $(BUILD)/helpers/shape.o
	$(LINK) $^ -o $@ -lm

$(BUILD)/view: $(addprefix $(BUILD)/helpers/,view.o render.o) $(MESHES) $(IMAGES)
	$(LINK) $^ -o $@ -lcjson $(PICTURES) -lm

# ---- examples and benchmarks

examples: $(EXAMPLES)

$(BUILD)/examples/%: examples/%.c $(BUILD)/files/stb.o $(SOURCES)
	@mkdir -p $(@D)
	$(COMPILE) $(filter %.c %.o,$^) -o $@ $(LIBRARIES) $(if $(filter %/mesh.o,$^),-lcjson) $(if $(filter %/image_io.o,$^),$(PICTURES)) -lm

# those of more than one file have a folder of their own
$(BUILD)/examples/%: examples/%/main.c $(BUILD)/files/stb.o $(SOURCES)
	@mkdir -p $(@D)
	$(COMPILE) $(filter %.c %.o,$^) -o $@ $(LIBRARIES) $(if $(filter %/mesh.o,$^),-lcjson) $(if $(filter %/image_io.o,$^),$(PICTURES)) -lm

$(BUILD)/examples/membrane: $(wildcard examples/membrane/*)
$(BUILD)/examples/terrain: $(wildcard examples/terrain/*)
$(BUILD)/examples/membrane: $(BUILD)/helpers/render.o $(MESHES) $(IMAGES)
$(BUILD)/examples/repair: $(BUILD)/helpers/render.o $(MESHES) $(IMAGES)
$(BUILD)/examples/join: $(IMAGES)
$(BUILD)/examples/join: CPPFLAGS += -D_FILE_OFFSET_BITS=64
$(BUILD)/examples/brush: $(wildcard examples/brush/*)
$(BUILD)/examples/brush: LIBRARIES = $(SDL)
$(BUILD)/examples/forest_gl: $(wildcard examples/forest_gl/*)
$(BUILD)/examples/forest_gl: LIBRARIES = $(GL) $(SDL) -lcjson
$(BUILD)/examples/forest_gl: CPPFLAGS += $(if $(SDL),-DFOREST_WINDOW) \
    -DFOREST_SHADERS='"$(PREFIX)/share/texkit/shaders"'

# in reverse order: sand, a common case, comes first and is swept over all sizes
bench: $(BENCHES) $(PLAIN) samples
	@for b in $(BENCHES); do $$b $$(ls -r $(BUILD)/samples/*.png) || exit 1; done

$(BUILD)/bench/%: bench/%.c $(wildcard bench/*.h) $(TIMED) $(SOURCES)
	@mkdir -p $(@D)
	$(COMPILE) $< $(filter %.o,$^) -o $@ $(if $(filter %/mesh.o,$^),-lcjson) $(PICTURES) -lm

# the same without SIMD, for comparison
$(BUILD)/bench/plain/%: bench/%.c $(wildcard bench/*.h) $(TIMED) $(SOURCES)
	@mkdir -p $(@D)
	$(COMPILE) -DTEXSYN_NO_SIMD -DTEXTILES_NO_SIMD -DTEXPATCH_NO_SIMD -DTEXINPAINT_NO_SIMD \
	    $< $(filter %.o,$^) -o $@ $(if $(filter %/mesh.o,$^),-lcjson) $(PICTURES) -lm

$(BUILD)/bench/bench_inpaint $(BUILD)/bench/plain/bench_inpaint: $(MESHES)

# ---- demo, tests, lint

samples: helpers
	@BUILD=$(BUILD) tools/samples.sh

# which examples there are is known when make starts, so it starts again behind the set-up
demo:
	@CC="$(CC)" tools/setup.sh demo || echo "demo: without OpenGL no trees are drawn"
	@$(MAKE) --no-print-directory all samples examples
	@BUILD=$(BUILD) tools/demo.sh

# a few minutes, or less than one where little has changed; and all that is worth trying
test check:
	@CC="$(CC)" tools/setup.sh test
	@CC="$(CC)" CXX="$(CXX)" BUILD="$(BUILD)" tests/run.sh $@

include tests/build.mk

# Implementations are checked once: by cppcheck in tools/modules, with SIMD and without (the two sets of
# macros; all that it makes up by itself take it eight times as long); by clang-tidy module by module, and
# by its analyser, which looks at the functions of the file it is given, part by part. (Of a whole module
# it does not look again at functions that it has seen called, and misses what other callers bring.) All
# else is checked without them, by cppcheck with threads and windows, by clang-tidy without. clang-tidy 14
# finds uninitialised va_lists that are none once it reads several files in one run
IMPLEMENTED = $(wildcard tools/modules/*.c)
LINTED = $(filter-out $(IMPLEMENTED),$(wildcard tools/*.c tools/*/*.c examples/*.c examples/*/*.c bench/*.c))
PARTS  = $(wildcard src/*/*.h)
MACROS := $(foreach m,$(basename $(HEADERS)),$(shell echo $(m) | tr a-z A-Z))
BARE   := $(MACROS:%=-D%_IMPLEMENTED)
CPPCHECK = cppcheck --quiet -j 2 --std=c99 --enable=warning,performance,portability --inline-suppr \
    --error-exitcode=1 --suppress=missingIncludeSystem '--suppress=uninitvar:src/texmath/*' -Isrc -Itools
# How many states of a function the analyser looks at: a quarter of its default takes half the time
NODES  = $(if $(filter 1,$(FULL)),225000,60000)
# TIDY,OPTIONS,FLAGS: of the files whose names are on stdin
TIDY   = xargs -P 2 -I FILE clang-tidy --quiet --warnings-as-errors='*' $(1) FILE -- -std=c99 -Isrc $(2) \
    -Xclang -analyzer-config -Xclang max-nodes=$(NODES)
SYNTAX = '--checks=-clang-analyzer-*' '--header-filter=^src/'
PATHS  = '--checks=-bugprone-*,-performance-*,-portability-*'

lint:
	@tools/setup.sh lint
	$(CPPCHECK) $(BARE) $(FORMATS) -D_OPENMP=201511 -DFOREST_WINDOW $(LINTED)
	$(CPPCHECK) -D__GNUC__ -D__x86_64__ -D__SSE2__ $(IMPLEMENTED)
	$(CPPCHECK) -D__GNUC__ -D__aarch64__ $(IMPLEMENTED)
	printf '%s\n' $(LINTED) $(IMPLEMENTED) | $(call TIDY,,-Itools $(FORMATS) $(BARE))
	ls src/*.h | $(call TIDY,$(SYNTAX),-xc $(MACROS:%=-D%_IMPLEMENTATION) -Wno-unused-function)
	ls -S $(PARTS) | $(call TIDY,$(PATHS),-xc -Wno-unused-function)

# ---- installing

install: all
	install -d "$(DESTDIR)$(PREFIX)/bin" "$(DESTDIR)$(PREFIX)/include/texkit" \
	    "$(DESTDIR)$(PREFIX)/lib/pkgconfig" "$(DESTDIR)$(PREFIX)/share/texkit/shaders"
	install -m 755 $(BUILD)/texkit "$(DESTDIR)$(PREFIX)/bin/texkit"
	install -m 644 $(HEADERS) "$(DESTDIR)$(PREFIX)/include/texkit"
	install -m 644 shaders/*.glsl "$(DESTDIR)$(PREFIX)/share/texkit/shaders"
	sed 's|@PREFIX@|$(PREFIX)|; s|@VERSION@|$(VERSION)|' tools/texkit.pc.in \
	    > "$(DESTDIR)$(PREFIX)/lib/pkgconfig/texkit.pc"

uninstall:
	rm -f "$(DESTDIR)$(PREFIX)/bin/texkit" "$(DESTDIR)$(PREFIX)/lib/pkgconfig/texkit.pc"
	rm -rf "$(DESTDIR)$(PREFIX)/include/texkit" "$(DESTDIR)$(PREFIX)/share/texkit"

clean:
	rm -rf $(BUILD) out
