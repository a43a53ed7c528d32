# build.mk - how tests are built and run; the Makefile includes it, tests/run.sh counts what came out
#
# Each module is compiled once with the sanitizers; the unit tests link that object. A test that has
# passed leaves build/tests/MODE/NAME.done and is not run again until something that it depends on
# has changed. MODE is test or check, as in `make test` and `make check`.

.SUFFIXES: # or make takes tests/wide/fuzz for something to be made of fuzz.sh
TESTS    := $(BUILD)/tests
FULL     ?= 0
MODULES  := $(filter-out texmath,$(basename $(HEADERS)))
# -Og: in gcc half the time of -O1 to compile, mostly about the same to run. What null and object-size
# look for the address sanitizer sees as well
SANITIZE  = -Og -g1 -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=undefined \
            -fno-sanitize=null,object-size
# the longest first, so that none is left to run alone
LONG      = test_trimesh_relax test_textiles_exemplars test_texsyn test_trimesh_repel
UNITS    := $(basename $(notdir $(wildcard tests/unit/test_*.c)))
UNITS    := $(filter $(LONG),$(UNITS)) $(filter-out $(LONG),$(UNITS))
GOLDEN    = texmath texsyn texpatch texedges textiles trimesh_relax trimesh_cover texinpaint treepieces
TEST_C    = $(CC) -std=gnu99 -ffp-contract=off -Wall -Wextra -Isrc -Itests/kit -Itools -MMD -MP

# ---- what is tested: modules, tool and their unit tests, with the sanitizers

# too large sets of tiles are then quickly made
$(TESTS)/modules/textiles.o: OPTIONS = -DTEXTILES_MAX_PIXELS=4194304
# their tests compute for long: nearly twice as fast for some seconds more of the compiler. (-O2 takes it
# twice as long again, for another fifth)
$(TESTS)/modules/texsyn.o: OPTIONS = -O1
$(TESTS)/modules/texpatch.o: OPTIONS = -O1
$(TESTS)/modules/trimesh_relax.o: OPTIONS = -O1

$(TESTS)/modules/%.o: src/%.h tests/build.mk
	@mkdir -p $(@D)
	printf '#define %s_IMPLEMENTATION\n#include "%s.h"\n' $$(echo $* | tr a-z A-Z) $* >$(@:.o=.c)
	$(TEST_C) $(SANITIZE) $(OPTIONS) -MT $@ -c $(@:.o=.c) -o $@

$(TESTS)/asan/%.o: tools/%.c tests/build.mk | setup
	@mkdir -p $(@D)
	$(COMPILE) $(SANITIZE) -MMD -MP -c $< -o $@

# stb shifts into the sign bit on purpose
$(TESTS)/asan/files/stb.o: SANITIZE += -fno-sanitize=undefined

# the tool has the modules of the unit tests, but for textiles.h, whose limit is another there
TOOL_OBJECTS = $(TEXKIT:$(BUILD)/%=$(TESTS)/asan/%)
TESTED       = $(filter-out %/textiles.o,$(filter $(TESTS)/asan/modules/%,$(TOOL_OBJECTS)))
$(TESTS)/asan/texkit: $(filter-out $(TESTED),$(TOOL_OBJECTS)) $(TESTED:$(TESTS)/asan/%=$(TESTS)/%)
	$(LINK) $(SANITIZE) $^ -o $@ -lcjson $(PICTURES) -lm

# those that look inside a module include the parts that they test, or all of it; the others hold
# nothing that is worth optimising
inside = $(findstring _IMPLEMENTATION,$(file <$(1)))$(foreach m,$(MODULES),$(findstring "$(m)/,$(file <$(1))))

$(TESTS)/unit/%.o: tests/unit/%.c tests/build.mk
	@mkdir -p $(@D)
	$(TEST_C) $(SANITIZE) $(if $(strip $(call inside,$<)),-Wno-unused-function,-O0) -c $< -o $@

$(TESTS)/unit/%: $(TESTS)/unit/%.o
	$(CC) $(SANITIZE) $^ -o $@ -lcmocka -lpthread $(if $(filter %/image_io.o,$^),-lcjson $(PICTURES)) -lm

# links.mk says which objects a unit test is linked with: those of the headers that it includes,
# itself or by way of the kit, but for modules whose implementation it holds to see what is private
$(TESTS)/links.mk: $(wildcard tests/unit/*.c tests/kit/*.h) tests/kit/links.awk
	@mkdir -p $(@D)
	@awk -v modules="$(MODULES)" -v root="$(TESTS)" \
	    -v files="$(patsubst tools/%.c,$(TESTS)/asan/%.o,$(wildcard tools/files/*.c))" \
	    -f tests/kit/links.awk $(wildcard tests/kit/*.h tests/unit/*.c) >$@

# ---- golden programs, with the sanitized objects, and for tests/wide/same_bytes.sh with those of the tool

GOLDEN_C = @mkdir -p $(@D) && $(TEST_C) -Itests/wide/golden

$(TESTS)/golden/golden_%: tests/wide/golden/golden_%.c $(TESTS)/modules/%.o
	$(GOLDEN_C) $(SANITIZE) -D$$(echo $* | tr a-z A-Z)_IMPLEMENTED $^ -o $@ -lpthread -lm

$(BUILD)/golden/golden_%: tests/wide/golden/golden_%.c $(BUILD)/modules/%.o
	$(GOLDEN_C) -O2 -D$$(echo $* | tr a-z A-Z)_IMPLEMENTED $^ -o $@ -lpthread -lm

# texmath.h has no object
$(TESTS)/golden/golden_texmath: tests/wide/golden/golden_texmath.c
	$(GOLDEN_C) $(SANITIZE) $< -o $@ -lpthread -lm

$(BUILD)/golden/golden_texmath: tests/wide/golden/golden_texmath.c
	$(GOLDEN_C) -O2 $< -o $@ -lpthread -lm

# the hashes that every build must give, written anew: only where output bytes change on purpose
golden: $(GOLDEN:%=$(BUILD)/golden/golden_%)
	tests/wide/golden/compare.sh --write $^

# ---- running: NAME.done is made by a test that has passed, NAME.log holds what it printed

KIT      := $(wildcard tests/kit/*)
HELPERS   = $(addprefix $(BUILD)/,crop draw scan shape view)
TOOL_RUNS = $(filter-out tool_quick,$(patsubst tests/tool/%.sh,tool_%,$(wildcard tests/tool/*.sh)))
LOOK_RUNS = $(patsubst tests/look/%.sh,look_%,$(wildcard tests/look/*.sh))
WIDE_RUNS := $(patsubst tests/wide/%.sh,wide_%,$(filter-out tests/wide/sources.sh,$(wildcard tests/wide/*.sh)))
# the longest first, but the one that uses what headers.sh has compiled
WIDE_RUNS := wide_headers wide_fuzz $(filter-out wide_headers wide_fuzz wide_same_bytes,$(WIDE_RUNS)) wide_same_bytes

# SWEEPING, of links.mk: the unit tests that try more in `make check`. What both modes try alike is
# run once
unit_runs = $(foreach u,$(UNITS),$(if $(filter $(u),$(SWEEPING)),$(1),test)/$(u))
TEST_RUN  = wide_sources $(GOLDEN:%=golden_%) tool_quick $(MODULES:%=quick_%) quick_texmath
CHECK_RUN = $(GOLDEN:%=golden_%) wide_sources tool_quick

# programs and modules to compile come with what runs, so that both processors have work
ALL_test  = $(patsubst %,$(TESTS)/%,$(call unit_runs,test) $(TEST_RUN:%=test/%))
ALL_check = $(patsubst %,$(TESTS)/%,$(addprefix check/,$(WIDE_RUNS) $(TOOL_RUNS) $(LOOK_RUNS)) \
              $(call unit_runs,check) $(CHECK_RUN:%=test/%))

test-run: $(ALL_test:=.done)
check-run: $(ALL_check:=.done)
test-list check-list: # what run.sh counts
	@printf '%s\n' $(ALL_$(@:-list=))

# `make check` goes through everything in these and in the unit tests; `make check FULL=1` in all
FULL_RUNS = look_picture
full      = $(if $(filter check,$(1)),$(if $(filter $(2),$(FULL_RUNS)),1,$(FULL)),0)

# mode_rules MODE FULL
define mode_rules
$(TESTS)/$(1)/test_%.done: $(TESTS)/unit/test_%
	@FULL=$(2) tests/run.sh --one $$@ $$<

$(TESTS)/$(1)/tool_%.done: tests/tool/%.sh $(wildcard tests/tool/*) $(KIT) $(TESTS)/asan/texkit \
        $(if $(filter test,$(1)),$(addprefix $(BUILD)/,draw scan shape),$(HELPERS))
	@FULL=$$(call full,$(1),tool_$$*) tests/run.sh --one $$@ sh $$<

$(TESTS)/$(1)/look_%.done: tests/look/%.sh $(wildcard tests/look/* shaders/*) $(KIT) $(HELPERS)
	@FULL=$$(call full,$(1),look_$$*) tests/run.sh --one $$@ sh $$<

$(TESTS)/$(1)/wide_%.done: tests/wide/%.sh $(wildcard tests/wide/*/*) $(KIT) $(HELPERS) $(SOURCES) \
        $(wildcard *.h *.md examples/*)
	@FULL=$$(call full,$(1),wide_$$*) tests/run.sh --one $$@ sh $$<
endef
$(eval $(call mode_rules,test,0))
$(eval $(call mode_rules,check,1))

# these also run the tool as users have it; and an example
$(patsubst %,$(TESTS)/check/%.done,$(TOOL_RUNS) $(LOOK_RUNS) $(WIDE_RUNS)): $(BUILD)/texkit
$(TESTS)/check/tool_plane.done: $(BUILD)/examples/join examples/plane.sh
$(TESTS)/check/wide_examples.done: $(EXAMPLES)
$(TESTS)/check/wide_fuzz.done: $(MODULES:%=$(TESTS)/modules/%.o)
$(TESTS)/check/wide_fuzz_image.done: $(TESTS)/asan/files/stb.o
$(TESTS)/check/wide_same_bytes.done: $(GOLDEN:%=$(BUILD)/golden/golden_%)
$(TESTS)/check/look_brush.done: $(filter %/brush,$(EXAMPLES))
$(TESTS)/check/look_forest_gl.done: $(filter %/forest_gl,$(EXAMPLES))

$(TESTS)/test/golden_%.done: $(TESTS)/golden/golden_% tests/wide/golden/compare.sh \
        tests/wide/golden/golden.txt
	@tests/run.sh --one $@ tests/wide/golden/compare.sh --tap "$< 3"

$(TESTS)/test/quick_%.done: tests/wide/manual.sh $(KIT) texmath.h %.h README.md CHANGELOG.md
	@FULL=0 tests/run.sh --one $@ sh $< $*.h

# the first and cheapest needs no tool
$(TESTS)/test/wide_sources.done: tests/wide/sources.sh $(KIT) $(SOURCES) $(HEADERS) tools/headers.sh \
        $(wildcard tests/*/* tests/wide/*/* tools/* tools/*/* examples/* examples/*/* bench/*)
	@tests/run.sh --one $@ sh $<

.PRECIOUS: $(TESTS)/unit/%.o $(TESTS)/unit/% $(TESTS)/modules/%.o $(TESTS)/asan/%.o $(BUILD)/golden/% $(TESTS)/golden/%

ifneq ($(filter test-% check-% $(BUILD)/%,$(MAKECMDGOALS)),)
include $(TESTS)/links.mk
endif
-include $(wildcard $(BUILD)/golden/*.d $(TESTS)/*/*.d $(TESTS)/asan/*/*.d)
