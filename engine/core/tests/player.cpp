// player LIBRARY TAPE PICTURES: asks a build of the core for what a tape holds
// (tests/engine/core_tape.py says how) and writes the values of its pictures, one after the other.
// Only the library is of the core, so that the very file that users get is tried, on machines where
// there is no Python.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <vector>

#if defined(_WIN32)
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include "glint.h"

namespace {

[[noreturn]] void fail(const char* what, const char* detail = "") {
  std::fprintf(stderr, "player: %s %s\n", what, detail);
  std::exit(1);
}

class Library {
 public:
#if defined(_WIN32)
  explicit Library(const char* path) : handle_(LoadLibraryA(path)) {
    if (!handle_) fail("cannot load", path);
  }
  void* find(const char* name) const {
    return reinterpret_cast<void*>(GetProcAddress(handle_, name));
  }

 private:
  HMODULE handle_;
#else
  explicit Library(const char* path) : handle_(dlopen(path, RTLD_NOW | RTLD_LOCAL)) {
    if (!handle_) fail("cannot load", dlerror());
  }
  void* find(const char* name) const { return dlsym(handle_, name); }

 private:
  void* handle_;
#endif
};

template <class Function>
Function* function(const Library& library, const char* name) {
  void* found = library.find(name);
  if (!found) fail("the library has no", name);
  Function* typed;
  std::memcpy(&typed, &found, sizeof typed);
  return typed;
}

struct Core {
  explicit Core(const Library& library)
      : version(function<decltype(glint_abi_version)>(library, "glint_abi_version")),
        isa(function<decltype(glint_isa)>(library, "glint_isa")),
        scene(function<decltype(glint_scene_create)>(library, "glint_scene_create")),
        like(function<decltype(glint_scene_create_like)>(library, "glint_scene_create_like")),
        drop(function<decltype(glint_scene_destroy)>(library, "glint_scene_destroy")),
        start(function<decltype(glint_render_start)>(library, "glint_render_start")),
        wait(function<decltype(glint_render_wait)>(library, "glint_render_wait")),
        move(function<decltype(glint_render_move)>(library, "glint_render_move")),
        picture(function<decltype(glint_render_picture)>(library, "glint_render_picture")),
        values(function<decltype(glint_picture_values)>(library, "glint_picture_values")),
        free_picture(function<decltype(glint_picture_free)>(library, "glint_picture_free")),
        error(function<decltype(glint_render_error)>(library, "glint_render_error")),
        finish(function<decltype(glint_render_destroy)>(library, "glint_render_destroy")) {}

  decltype(glint_abi_version)* version;
  decltype(glint_isa)* isa;
  decltype(glint_scene_create)* scene;
  decltype(glint_scene_create_like)* like;
  decltype(glint_scene_destroy)* drop;
  decltype(glint_render_start)* start;
  decltype(glint_render_wait)* wait;
  decltype(glint_render_move)* move;
  decltype(glint_render_picture)* picture;
  decltype(glint_picture_values)* values;
  decltype(glint_picture_free)* free_picture;
  decltype(glint_render_error)* error;
  decltype(glint_render_destroy)* finish;
};

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

File opened(const char* path, const char* mode) {
  File file(std::fopen(path, mode));
  if (!file) fail("cannot open", path);
  return file;
}

// The numbers are those of Operation in core_tape.py.
enum Operation : uint64_t {
  kEnd,
  kBlock,
  kScene,
  kLike,
  kDrop,
  kStart,
  kWait,
  kMove,
  kPicture,
  kFinish,
  kForget
};
constexpr uint64_t kMagic = 0x4550'4154'544e'4c47;  // "GLNTTAPE"

class Player {
 public:
  Player(const Core& core, const char* tape, const char* pictures)
      : core_(core), tape_(opened(tape, "rb")), pictures_(opened(pictures, "wb")) {
    if (word() != kMagic) fail("this is no tape:", tape);
    if (word() != core.version()) fail("the tape is of another version of the interface");
  }

  // The number of pictures.
  uint64_t play() {
    uint64_t count = 0;
    for (uint64_t operation = word(); operation != kEnd; operation = word()) {
      step(operation);
      count += operation == kPicture;
    }
    if (std::fflush(pictures_.get()) != 0) fail("the pictures cannot be written");
    return count;
  }

 private:
  void step(uint64_t operation) {
    switch (operation) {
      case kBlock: return read_block();
      case kScene: {
        const uint64_t slot = word();
        return keep(slot, core_.scene(block<GlintSceneData>(), error_, sizeof error_));
      }
      case kLike: {
        const uint64_t slot = word();
        const GlintScene* base = scene();
        const auto* data = block<GlintSceneData>();
        const auto exact = static_cast<int32_t>(word());
        return keep(slot, core_.like(base, data, exact, error_, sizeof error_));
      }
      case kDrop: return core_.drop(scene());
      case kStart: {
        GlintScene* told = scene();
        render_ = core_.start(told, block<GlintRenderSettings>(), error_, sizeof error_);
        if (!render_) fail("the core refuses a render:", error_);
        return;
      }
      case kWait: return wait();
      case kMove: {
        GlintScene* told = scene();
        if (core_.move(render_, told, block<GlintRenderSettings>(), error_, sizeof error_) != 0)
          fail("the core refuses the next moment:", error_);
        return;
      }
      case kPicture: return write_picture();
      case kFinish: return core_.finish(render_);
      case kForget: return blocks_.clear();
      default: fail("the tape holds an unknown operation");
    }
  }

  uint64_t word() {
    uint64_t value = 0;
    if (std::fread(&value, sizeof value, 1, tape_.get()) != 1) fail("the tape ends too early");
    return value;
  }

  void read_block() {
    const uint64_t bytes = word(), pointers = word();
    // Of 64-bit words, so that it is aligned for whatever it holds.
    std::vector<uint64_t> words((bytes + 7) / 8);
    if (std::fread(words.data(), 8, words.size(), tape_.get()) != words.size())
      fail("the tape ends too early");
    for (uint64_t k = 0; k < pointers; ++k) {
      const uint64_t offset = word(), target = word();
      words.at(offset / 8) = reinterpret_cast<uintptr_t>(blocks_.at(target).data());
    }
    blocks_.push_back(std::move(words));
  }

  template <class Structure>
  const Structure* block() {
    const std::vector<uint64_t>& words = blocks_.at(word());
    if (words.size() * 8 < sizeof(Structure)) fail("a structure has another size here");
    return reinterpret_cast<const Structure*>(words.data());
  }

  GlintScene* scene() { return scenes_.at(word()); }

  void keep(uint64_t slot, GlintScene* made) {
    if (!made) fail("the core refuses a scene:", error_);
    scenes_[slot] = made;
  }

  void wait() {
    for (;;) {
      const int32_t state = core_.wait(render_, 1000).state;
      if (state == GLINT_FAILED) fail("the core failed:", core_.error(render_));
      if (state == GLINT_DONE || state == GLINT_MOVING) return;
    }
  }

  void write_picture() {
    const auto pass = static_cast<int32_t>(word());
    const uint64_t size = word();
    GlintPicture* picture = core_.picture(render_, pass, size);
    if (!picture) fail("the core has no such picture");
    if (std::fwrite(core_.values(picture), 4, size, pictures_.get()) != size)
      fail("the pictures cannot be written");
    core_.free_picture(picture);
  }

  const Core& core_;
  File tape_, pictures_;
  std::vector<std::vector<uint64_t>> blocks_;
  std::map<uint64_t, GlintScene*> scenes_;
  GlintRender* render_ = nullptr;
  char error_[8192] = "";
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) fail("usage: player LIBRARY TAPE PICTURES");
  const Library library(argv[1]);
  const Core core(library);
  Player player(core, argv[2], argv[3]);
  const auto pictures = static_cast<unsigned long long>(player.play());
  std::printf("player: %llu pictures with %s\n", pictures, core.isa());
  return 0;
}
