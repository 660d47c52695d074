# make run    installs what is missing, builds, starts the daemon
# make test   installs what tests need, builds, runs all tests
# make web-test   tests the web page in Chromium; make test does so too where a browser and npm packages can be had
# make demo   four pictures into out/, with their timings
# make validate   measures the bounds of optics and radiosity and draws the paper's figures into docs/validation/, some minutes
# make judge   measures the slab against its reference over 24 scenes and writes docs/judge, some 20 minutes; goes on where it was stopped
# make gallery   draws the pictures of docs/gallery
# make fuzz     throws bytes at every reader of what strangers send, FUZZ_SECONDS (600) each; FUZZ="name name" takes these alone
# make load     offers a daemon half of what it can do up to four times as much; two and a half minutes
# make golden    writes what the golden render is now into renderer/golden_values.inc: after a change of what pictures look like
# make scene-classes   writes the Python package's classes of a scene anew, after openapi.yaml changed
# make soak     twenty minutes of mixed load with faults injected
# make install   puts programs, manual and systemd unit below PREFIX (/usr/local), all below DESTDIR; make uninstall takes them away
# make image     builds the container image and renders a picture with it
# SAN=address,undefined before any of them builds with sanitizers, in a folder of its own.

SHELL := /bin/bash
.DEFAULT_GOAL := all
.DELETE_ON_ERROR:

comma := ,
SAN ?=
B := build$(if $(SAN),/san-$(subst $(comma),-,$(SAN)))

CC := gcc
CXX := g++
OPT ?= -O2 -g
SANFLAGS := $(if $(SAN),-fsanitize=$(SAN) -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
CPPFLAGS := -I. -D_GNU_SOURCE -D_FORTIFY_SOURCE=2 -MMD -MP
CFLAGS = -std=c17 $(OPT) -Wall -Wextra -Werror -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wvla -fstack-protector-strong $(SANFLAGS) $(EXTRA_CFLAGS)
CXXFLAGS := -std=c++17 $(OPT) -Wall -Wextra -Werror $(SANFLAGS)
LDFLAGS := $(SANFLAGS) -pthread -Wl,-z,relro,-z,now

# Debian packages: to build and run, and to test. scripts/packages.sh installs those that are missing.
PACKAGES := gcc g++ libc6-dev pkg-config libepoxy-dev libegl-dev libegl1 libegl-mesa0 libgl1-mesa-dri libopenimageio-dev \
	zlib1g-dev libpng-dev libopenexr-dev libmicrohttpd-dev libgnutls28-dev libjansson-dev libnova-dev nettle-dev libxxhash-dev libcminpack-dev libcurl4-openssl-dev ca-certificates curl
TEST_PACKAGES := libcmocka-dev libglm-dev python3 python3-pytest python3-numpy python3-openimageio python3-yaml openexr openssl clang-format procps \
	python3-prometheus-client mandoc systemd ffmpeg gnuplot-nox
# The page's tests need a browser, and Node.js with npm for playwright-core and axe-core, unless those are there from elsewhere.
WEB_PACKAGES := chromium fonts-dejavu-core $(if $(shell command -v node),,nodejs) $(if $(shell command -v npm),,npm)
VALIDATE_PACKAGES := gnuplot-nox
GALLERY_PACKAGES := imagemagick
FUZZ_PACKAGES := clang llvm

pkg = $(shell pkg-config $(1) $(2))
RENDERER_LIBS = $(call pkg,--libs,epoxy libxxhash cminpack) -lEGL -lm
SERVER_LIBS = $(call pkg,--libs,libmicrohttpd gnutls jansson nettle) -lnova -ldl
CLIENT_LIBS = $(call pkg,--libs,libcurl jansson libpng) -lOpenEXRCore

# --- what is built from what -------------------------------------------------------------------------------------------------
# renderer/ without its programs and its C++ is one archive; it knows no HTTP, JSON or OpenImageIO (render-bench proves it).
RENDERER_SRC := $(wildcard renderer/*.c renderer/optics/*.c renderer/gl/*.c renderer/stages/*.c renderer/image/*.c)
SERVER_SRC := $(filter-out server/main.c,$(wildcard server/*.c))
CLIENT_SRC := $(wildcard clients/*.c clients/bench/*.c)
UNIT_SRC := $(wildcard tests/unit/test_*.c)
VALIDATE_SRC := $(wildcard tests/validate/*.c)
UNIT_CXX := $(wildcard tests/unit/test_*.cpp)
SHADERS := $(wildcard shaders/*.glsl shaders/*/*.glsl)
RESOURCES := openapi.yaml $(wildcard server/pages/*.* server/pages/*/*.* server/presets/*.json)

obj = $(patsubst %,$(B)/%.o,$(1))
RENDERER_OBJ := $(call obj,$(RENDERER_SRC)) $(B)/gen/shaders.o
PROGRAMS := $(B)/stratusd $(B)/stratus $(B)/stratus-kernel $(B)/render-bench
UNIT := $(patsubst tests/unit/%.c,$(B)/tests/%,$(UNIT_SRC)) $(patsubst tests/unit/%.cpp,$(B)/tests/%,$(UNIT_CXX))

.PHONY: all programs kernel man install uninstall image run test fuzz replays load soak demo gallery validate judge golden scene-classes unit http format clean packages test-packages web-packages web-test
all: programs kernel
programs: $(PROGRAMS) $(B)/stratus-image.so

# The Mie kernel table does not depend on sanitizers: always made by the plain program, anew when what it says has changed.
kernel: build/mie.kernel
MIE_SRC := $(wildcard renderer/optics/mie*.c renderer/optics/kernel*.c) renderer/optics/quadrature.c
KERNEL_SRC := renderer/programs/kernel.c $(MIE_SRC) renderer/file_replace.c renderer/log.c
ifeq ($(SAN),)
build/mie.kernel: $(MIE_SRC) renderer/optics/kernel_table.h | build/stratus-kernel
	build/stratus-kernel -o $@
else
build/mie.kernel:
	$(MAKE) --no-print-directory SAN= $@
endif
$(B)/stratus-kernel: $(call obj,$(KERNEL_SRC))
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) $^ -o $@ -lm

$(B)/librenderer.a: $(RENDERER_OBJ)
	rm -f $@; ar rcs $@ $^
$(B)/libserver.a: $(call obj,$(SERVER_SRC)) $(B)/gen/resources.o
	rm -f $@; ar rcs $@ $^

$(B)/stratusd: $(call obj,server/main.c) $(B)/libserver.a $(B)/librenderer.a
	$(CC) $(LDFLAGS) $^ -o $@ $(SERVER_LIBS) $(RENDERER_LIBS)
# For tests: the same with a GPU, a driver and a memory that can be told to fail (tests/faults/faults.c).
$(B)/stratusd-faulty: $(call obj,server/main.c tests/faults/faults.c) $(B)/libserver.a $(B)/librenderer.a
	$(CC) $(LDFLAGS) -Wl,--wrap=config_parse,--wrap=malloc,--wrap=image_module_load $^ -o $@ $(SERVER_LIBS) $(RENDERER_LIBS)
$(B)/stratus: $(call obj,$(CLIENT_SRC))
	$(CC) $(LDFLAGS) $^ -o $@ $(CLIENT_LIBS) -lm
$(B)/render-bench: $(call obj,renderer/programs/bench.c) $(B)/librenderer.a
	$(CC) $(LDFLAGS) $^ -o $@ $(RENDERER_LIBS) -ldl
$(B)/stratus-image.so: $(call obj,renderer/image/oiio.cpp) $(B)/pic/renderer/scene.c.o
	$(CXX) $(LDFLAGS) -shared $^ -o $@ $(call pkg,--libs,OpenImageIO zlib)

# The reference model on the processor: the shader as C++, for tests and validation.
TWIN_OBJ := $(call obj,tests/twin/layer.c tests/twin/twin.cpp)
$(B)/tests/twin/twin.cpp.o: tests/twin/twin.cpp $(SHADERS)
	@mkdir -p $(@D)
	$(CXX) $(CPPFLAGS) $(CXXFLAGS) -O3 -fsingle-precision-constant -fno-math-errno -fno-trapping-math -c $< -o $@

$(B)/stratus-validate: $(call obj,$(VALIDATE_SRC)) $(TWIN_OBJ) $(B)/librenderer.a
	$(CC) $(LDFLAGS) $^ -o $@ $(call pkg,--libs,jansson) $(RENDERER_LIBS) -lstdc++

$(B)/%.c.o: %.c
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) $(CFLAGS) -c $< -o $@
$(B)/pic/%.c.o: %.c
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) $(CFLAGS) -fPIC -c $< -o $@
$(B)/renderer/image/oiio.cpp.o: renderer/image/oiio.cpp
	@mkdir -p $(@D)
	$(CXX) $(CPPFLAGS) $(CXXFLAGS) -fPIC $(call pkg,--cflags,OpenImageIO) -c $< -o $@

$(B)/clients/image_info.c.o: CFLAGS += $(call pkg,--cflags,libpng OpenEXR)
$(B)/renderer/optics/paper_fit_solve.c.o: CFLAGS += $(call pkg,--cflags,cminpack)

# The optics are the one place where the compiler's best vector code is worth asking for: nobody there reads errno or traps.
OPTICS_OPT := -O3 -g -ffp-contract=fast -fno-math-errno -fno-trapping-math
$(B)/renderer/optics/%.c.o: OPT := $(OPTICS_OPT)
# The exchange between ground and clouds likewise.
$(B)/renderer/stages/fourier.c.o $(B)/renderer/stages/exchange.c.o $(B)/renderer/stages/radiosity_solve.c.o: OPT := $(OPTICS_OPT)

# Files of what the optics computed say by which sources, compiler, flags and solver.
OPTICS_TEXT := $(wildcard renderer/optics/*.[ch]) Makefile
$(B)/gen/optics_digest.h: OPT := $(OPTICS_OPT)
$(B)/gen/optics_digest.h: $(OPTICS_TEXT)
	@mkdir -p $(@D)
	@{ $(CC) --version; echo '$(CFLAGS)' $(call pkg,--modversion,cminpack); cat $(filter-out Makefile,$^); } | sha256sum | sed 's/^\(.\{32\}\).*/#define OPTICS_DIGEST "\1"/' >$@
$(B)/renderer/optics/droplet_file.c.o: CPPFLAGS += -I$(B)/gen
$(B)/renderer/optics/droplet_file.c.o: $(B)/gen/optics_digest.h

# Shaders and resources are embedded unchanged; the table maps names to bytes (renderer/embed.h).
$(B)/gen/shaders.S: $(SHADERS) scripts/embed.sh
	@mkdir -p $(@D)
	scripts/embed.sh shader_files $(SHADERS) >$@
$(B)/gen/resources.S: $(RESOURCES) scripts/embed.sh
	@mkdir -p $(@D)
	scripts/embed.sh resource_files $(RESOURCES) >$@
$(B)/gen/%.o: $(B)/gen/%.S
	$(CC) -c $< -o $@

$(B)/tests/%: tests/unit/%.c $(B)/libserver.a $(B)/librenderer.a
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) $(CFLAGS) -MF $@.d $< $(filter %.o,$^) $(B)/libserver.a $(B)/librenderer.a -o $@ $(LDFLAGS) -lcmocka $(SERVER_LIBS) $(RENDERER_LIBS)
$(B)/tests/%: tests/unit/%.cpp $(B)/librenderer.a $(SHADERS)
	@mkdir -p $(@D)
	$(CXX) $(CPPFLAGS) $(CXXFLAGS) -MF $@.d -fsingle-precision-constant $< $(B)/librenderer.a -o $@ $(LDFLAGS) -lcmocka $(RENDERER_LIBS)
$(B)/tests/test_reference_layer $(B)/tests/test_reference_twin: $(TWIN_OBJ)
$(B)/tests/test_reference_layer $(B)/tests/test_reference_twin: RENDERER_LIBS += -lstdc++
$(B)/tests/test_validate_bounds: $(call obj,tests/validate/bounds.c)
$(B)/tests/test_histogram: $(call obj,clients/bench/histogram.c)
$(B)/tests/test_deck: $(call obj,tests/validate/deck.c)
$(B)/tests/test_exchange: $(call obj,tests/validate/squares.c)
$(B)/tests/test_sky_light: $(call obj,tests/validate/air_photons.c)

# A fuzz target by itself runs the inputs that were kept (replay); with libFuzzer it looks for more.
FUZZ_TARGETS := $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZ_COMMON := $(call obj,tests/fuzz/scene.c) $(B)/libserver.a $(B)/librenderer.a
$(B)/fuzz/replay_%: $(B)/tests/fuzz/fuzz_%.c.o $(call obj,tests/fuzz/replay.c) $(FUZZ_COMMON)
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) $^ -o $@ $(SERVER_LIBS) $(RENDERER_LIBS)
$(B)/fuzz/fuzz_%: $(B)/tests/fuzz/fuzz_%.c.o $(FUZZ_COMMON)
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) -fsanitize=fuzzer $^ -o $@ $(SERVER_LIBS) $(RENDERER_LIBS)
replays: $(addprefix $(B)/fuzz/replay_,$(FUZZ_TARGETS))
fuzzers: $(addprefix $(B)/fuzz/fuzz_,$(FUZZ_TARGETS))
.PHONY: fuzzers
.PRECIOUS: $(B)/tests/fuzz/%.c.o

-include $(shell find $(B) -name '*.d' 2>/dev/null)

# --- manual and installation -------------------------------------------------------------------------------------------------
man: $(B)/stratusd.8 $(B)/stratus.1
$(B)/%: ops/man/%.in scripts/manual.sh $(B)/stratusd $(B)/stratus
	scripts/manual.sh $(B)/$(basename $*) $< >$@

PREFIX ?= /usr/local
SYSCONFDIR ?= /etc/stratus
UNITDIR ?= $(PREFIX)/lib/systemd/system
MANDIR = $(PREFIX)/share/man
COMPLETIONDIR = $(PREFIX)/share/bash-completion/completions
INSTALLED = $(PREFIX)/bin/stratusd $(PREFIX)/bin/stratus $(PREFIX)/lib/stratus/stratus-image.so \
	$(addprefix $(PREFIX)/share/stratus/,mie.kernel grafana-dashboard.json prometheus-alerts.yml) \
	$(MANDIR)/man8/stratusd.8 $(MANDIR)/man1/stratus.1 $(COMPLETIONDIR)/stratus $(UNITDIR)/stratusd.service

# The operator's settings are left as they are, by uninstall too.
install: all man
	install -d $(addprefix $(DESTDIR),$(sort $(dir $(INSTALLED))) $(SYSCONFDIR))
	install -m 755 $(B)/stratusd $(B)/stratus $(DESTDIR)$(PREFIX)/bin
	install -m 644 $(B)/stratus-image.so $(DESTDIR)$(PREFIX)/lib/stratus
	install -m 644 build/mie.kernel ops/grafana-dashboard.json ops/prometheus-alerts.yml $(DESTDIR)$(PREFIX)/share/stratus
	install -m 644 $(B)/stratusd.8 $(DESTDIR)$(MANDIR)/man8
	install -m 644 $(B)/stratus.1 $(DESTDIR)$(MANDIR)/man1
	$(B)/stratus completion bash | install -m 644 /dev/stdin $(DESTDIR)$(COMPLETIONDIR)/stratus
	sed 's|@BINDIR@|$(PREFIX)/bin|; s|@SYSCONFDIR@|$(SYSCONFDIR)|' ops/stratusd.service | \
		install -m 644 /dev/stdin $(DESTDIR)$(UNITDIR)/stratusd.service
	test -e $(DESTDIR)$(SYSCONFDIR)/stratusd.env || install -m 640 ops/stratusd.env $(DESTDIR)$(SYSCONFDIR)/stratusd.env
uninstall:
	rm -f $(addprefix $(DESTDIR),$(INSTALLED))

# The container image, built and tried: by docker or podman, else (as root) by buildah over a base of debootstrap.
image:
	scripts/image.sh out/image

# --- what people type ----------------------------------------------------------------------------------------------------------
packages:
	@scripts/packages.sh $(PACKAGES)
test-packages: packages
	@scripts/packages.sh $(TEST_PACKAGES)

run: packages
	@$(MAKE) --no-print-directory -j$$(nproc) programs && $(MAKE) --no-print-directory kernel
	@scripts/run.sh $(B)

demo: packages
	@$(MAKE) --no-print-directory -j$$(nproc) programs && $(MAKE) --no-print-directory kernel
	@scripts/demo.sh $(B)

test: test-packages
	-@scripts/packages.sh $(WEB_PACKAGES)
	@$(MAKE) --no-print-directory -j$$(nproc) programs unit replays && $(MAKE) --no-print-directory kernel
	@scripts/test.sh $(B)

# The daemon and the fuzzers by clang, the image module as it is delivered: decoders of others are not ours to instrument.
FUZZ_SECONDS ?= 600
FUZZ ?= $(FUZZ_TARGETS)
# clang warns of members left to be zero where gcc does so only without designators.
FUZZ_BUILD := CC=clang SAN=fuzzer-no-link,address,undefined EXTRA_CFLAGS=-Wno-missing-field-initializers
fuzz: packages
	@scripts/packages.sh $(FUZZ_PACKAGES)
	@$(MAKE) --no-print-directory -j$$(nproc) build/stratus-image.so && $(MAKE) --no-print-directory kernel
	@$(MAKE) --no-print-directory -j$$(nproc) $(FUZZ_BUILD) fuzzers
	@scripts/fuzz.sh build/san-fuzzer-no-link-address-undefined/fuzz $(FUZZ_SECONDS) $(FUZZ)

load: packages
	@scripts/packages.sh python3
	@$(MAKE) --no-print-directory -j$$(nproc) programs && $(MAKE) --no-print-directory kernel
	@scripts/load.sh $(B)

soak: packages
	@scripts/packages.sh python3
	@$(MAKE) --no-print-directory -j$$(nproc) programs $(B)/stratusd-faulty && $(MAKE) --no-print-directory kernel
	@scripts/soak.sh $(B)

# PICTURES="name name" draws these alone.
gallery: packages
	@scripts/packages.sh $(GALLERY_PACKAGES)
	@$(MAKE) --no-print-directory -j$$(nproc) programs && $(MAKE) --no-print-directory kernel
	@scripts/gallery.sh $(B) $(PICTURES)

web-packages: packages
	@scripts/packages.sh $(WEB_PACKAGES)
web-test: web-packages
	@$(MAKE) --no-print-directory -j$$(nproc) $(B)/stratusd $(B)/stratus-image.so && $(MAKE) --no-print-directory kernel
	@scripts/web.sh $(B)

validate: packages
	@scripts/packages.sh $(VALIDATE_PACKAGES)
	@$(MAKE) --no-print-directory -j$$(nproc) $(B)/stratus-validate && $(MAKE) --no-print-directory kernel
	@scripts/validate.sh $(B)

# Figures are kept in out/judge for a run that was stopped; another program, or other scenes, begin anew.
judge: packages
	@scripts/packages.sh $(GALLERY_PACKAGES) python3
	@$(MAKE) --no-print-directory -j$$(nproc) programs && $(MAKE) --no-print-directory kernel
	@scripts/judge.sh $(B)

golden: packages
	@$(MAKE) --no-print-directory -j$$(nproc) programs && $(MAKE) --no-print-directory kernel
	$(B)/render-bench -g renderer/golden_values.inc

scene-classes:
	@scripts/packages.sh python3 python3-yaml
	/usr/bin/python3 clients/python/generate.py

# WITHOUT="name name": but for these.
unit: $(filter-out $(addprefix $(B)/tests/test_,$(WITHOUT)),$(UNIT)) $(B)/stratusd-faulty

format:
	clang-format -i $$(git ls-files '*.c' '*.h' '*.cpp')

clean:
	rm -rf build out
