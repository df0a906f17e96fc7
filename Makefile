# make run    set everything up and open the modeller (without a display: run the demo and say where the pictures are)
# make test   set everything up and pass the checks: format, lints, tests, docs
# make bench  the benchmarks behind the README's tables
# make session  a sculpting session with real mouse and key events on a virtual display, with screenshots

CARGO ?= cargo
OUT ?= out/demo
VOXCLAY := $(or $(CARGO_TARGET_DIR),target)/release/voxclay

# name of the Debian package, and a file that shows that it is there
VULKAN_LOADER := $(firstword $(wildcard /usr/lib/*/libvulkan.so.1 /usr/lib64/libvulkan.so.1 /usr/lib/libvulkan.so.1))
VULKAN_DRIVER := $(firstword $(wildcard /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json))

# what the window needs beside a driver; opened while the program runs
WINDOW_LIBS := $(wildcard /usr/lib/*/libxkbcommon-x11.so.0 /usr/lib64/libxkbcommon-x11.so.0 /usr/lib/libxkbcommon-x11.so.0)
WINDOW_PACKAGES := libxkbcommon-x11-0 libx11-xcb1 libxcursor1 libxi6 libxrandr2 libwayland-client0

.PHONY: run test bench session setup rust system window

run: setup
	$(CARGO) build --release --locked
ifeq ($(shell uname -s),Linux)
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ]; then $(MAKE) --no-print-directory window && { $(VOXCLAY) app || echo "If there is no window to be had here: $(VOXCLAY) demo -o $(OUT)"; }; \
	else echo "There is no display here, so the demo runs instead."; $(VOXCLAY) demo -o $(OUT); fi
else
	$(VOXCLAY) app
endif

test: setup
	$(CARGO) fmt --check
	$(CARGO) clippy --locked --all-targets -- -D warnings
	$(CARGO) test --locked
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --no-deps

bench: setup
	$(CARGO) bench --locked

session: setup
	$(CARGO) build --release --locked
	VOXCLAY=$(VOXCLAY) tests/session.sh

setup: rust system

window:
ifeq ($(WINDOW_LIBS),)
	@if command -v apt-get >/dev/null; then \
	  SUDO=$$([ "$$(id -u)" = 0 ] || echo sudo); \
	  echo "Installing what the window needs ($(WINDOW_PACKAGES))"; \
	  $$SUDO apt-get update -qq && DEBIAN_FRONTEND=noninteractive $$SUDO apt-get install -y -qq --no-install-recommends $(WINDOW_PACKAGES); \
	else \
	  echo "The window may need libxkbcommon-x11, libXcursor, libXi and libXrandr: install them if it does not open."; \
	fi
endif

rust:
	@command -v $(CARGO) >/dev/null || { echo "Voxclay is built with Rust 1.95 or newer: install it from https://rustup.rs, then run make again."; exit 1; }
	@command -v cc >/dev/null || { echo "No C linker found (cc): install gcc or clang (Debian: apt-get install build-essential)."; [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && apt-get install -y -qq build-essential; }

# A Vulkan driver draws; Mesa's software driver (lavapipe) is enough. The CPU renderer needs none.
system:
ifeq ($(shell uname -s),Linux)
ifeq ($(and $(VULKAN_LOADER),$(VULKAN_DRIVER)),)
	@if command -v apt-get >/dev/null; then \
	  SUDO=$$([ "$$(id -u)" = 0 ] || echo sudo); \
	  echo "Installing a Vulkan driver (mesa-vulkan-drivers, libvulkan1)"; \
	  $$SUDO apt-get update -qq && DEBIAN_FRONTEND=noninteractive $$SUDO apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1; \
	else \
	  echo "No Vulkan driver was found. Install one and run make again: Fedora: mesa-vulkan-drivers vulkan-loader; Arch: vulkan-swrast vulkan-icd-loader; openSUSE: Mesa-vulkan-drivers libvulkan1."; \
	  exit 1; \
	fi
endif
endif
