#include <algorithm>
#include <cmath>
#include <cstring>
#include <thread>

#include "fuzz_cases.h"
#include "fuzz_shortage.h"

namespace glint::fuzz {
namespace {

size_t pixels_of(const GlintRenderSettings& s) {
  return size_t(s.region[2] - s.region[0]) * (s.region[3] - s.region[1]);
}

/// The picture of the first wave that was there, which is to stay as it is whatever comes after.
class Kept {
 public:
  Kept() = default;
  Kept(const Kept&) = delete;
  Kept& operator=(const Kept&) = delete;
  void look(GlintRender* render, const GlintRenderSettings& s) {
    if (picture_) return;
    const size_t size = 4 * pixels_of(s);
    picture_ = glint_render_picture(render, GLINT_PASS_COMBINED, size);
    if (picture_) copy_.assign(values(), values() + size);
  }
  ~Kept() {
    if (!picture_) return;
    expect(std::equal(copy_.begin(), copy_.end(), values()),
           "a later wave was drawn into the picture of an earlier one");
    glint_picture_free(picture_);
  }

 private:
  const float* values() const { return glint_picture_values(picture_); }
  GlintPicture* picture_ = nullptr;
  std::vector<float> copy_;
};

/// Numbers of a pass; of AOVs and light groups those of as many as have a picture.
size_t size_of(GlintRender* render, const GlintRenderSettings& s, int pass) {
  static constexpr size_t channels[GLINT_PASS_COUNT] = {4, 3, 3, 3, 3, 3, 3, 3, 1, 3, 3, 3, 1, 1, 1,
                                                        1, 1, 1, 1, 1, 1, 0, 0, 0, 4, 3, 3, 1, 3, 3,
                                                        3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 4, 3, 3};
  const bool crypto = pass >= GLINT_PASS_CRYPTO_OBJECT && pass <= GLINT_PASS_CRYPTO_ASSET;
  size_t size = pixels_of(s) * (crypto ? 2 * s.crypto_ids : channels[pass]);
  if (pass != GLINT_PASS_AOV && pass != GLINT_PASS_LIGHT_GROUPS) return size;
  for (size_t count = 1; count <= 3; ++count)
    if (GlintPicture* const found = glint_render_picture(render, pass, count * size)) {
      glint_picture_free(found);
      return count * size;
    }
  return size;
}

void check_pixels(GlintRender* render, const GlintRenderSettings& s) {
  for (int pass = 0; pass < GLINT_PASS_COUNT; ++pass) {
    const size_t size = size_of(render, s, pass);
    expect(!glint_render_picture(render, pass, size + 1), "a picture of the wrong size");
    GlintPicture* picture = glint_render_picture(render, pass, size);
    if (!picture) {
      expect(!(s.passes >> pass & 1), "there is no picture of a pass that was asked for");
      continue;
    }
    const float* values = glint_picture_values(picture);
    const bool finite =
        std::all_of(values, values + size, [](float x) { return std::isfinite(x); });
    expect(finite, ("a number of pass " + std::to_string(pass) + " is not finite").c_str());
    glint_picture_free(picture);
  }
}

/// The scenes of a moving render's samples, which live as long as it does. data: of the first one,
/// null where all samples are to be of that.
struct Moments {
  GlintScene* first = nullptr;
  const GlintSceneData* data = nullptr;
  Arena* arena = nullptr;
  std::vector<GlintScene*> made{};
  Moments(GlintScene* scene) : first(scene) {}
  Moments(GlintScene* scene, const GlintSceneData& of, Arena& in)
      : first(scene), data(&of), arena(&in) {}
  Moments(const Moments&) = delete;
  Moments& operator=(const Moments&) = delete;
  ~Moments() {
    for (GlintScene* scene : made) glint_scene_destroy(scene);
  }
};

/// The next sample's scene: another one or, where that is refused, the first again.
bool give(GlintRender* render, const GlintRenderSettings& s, Moments& moments, Dice& dice) {
  ErrorBuffer error(dice);
  if (moments.data && dice.chance(0.7)) {
    const GlintSceneData data = varied(dice, *moments.arena, *moments.data);
    GlintScene* const base = moments.made.empty() ? moments.first : moments.made.back();
    if (GlintScene* next =
            glint_scene_create_like(base, &data, dice.chance(0.5), error.data(), error.size)) {
      moments.made.push_back(next);
      if (glint_render_move(render, next, &s, error.data(), error.size) == 0) return true;
    }
    error.check();
  }
  return glint_render_move(render, moments.first, &s, nullptr, 0) == 0;
}

/// Mirrors and glass one behind the other can ask for millions of rays: after a while such a render
/// is cancelled, and has to end soon. Gives whether it came to its end. is_short: memory or threads
/// may run out.
bool run(GlintRender* render, const GlintRenderSettings& s, Moments& moments, Dice& dice,
         Kept& kept, bool is_short = false) {
  constexpr double kPatience = 15, kLongest = 60;  // seconds
  bool cancel = dice.chance(0.2);
  const bool by_another = cancel && dice.chance(0.5);
  const auto delay = std::chrono::microseconds(dice.below(3000));
  std::thread other;
  if (by_another)
    other = std::thread([=] {
      std::this_thread::sleep_for(delay);
      glint_render_cancel(render);
    });
  Dice moved = dice,
       pace = dice;  // how often it is thrown depends on the machine, and what comes after must not
  const auto start = Clock::now();
  GlintProgress progress{};
  do {
    progress = glint_render_wait(render, uint32_t(pace.below(30)));
    expect(progress.fraction >= 0 && progress.fraction <= 1, "the fraction is not between 0 and 1");
    kept.look(render, s);
    if (progress.state == GLINT_HELD) glint_render_resume(render);
    if (progress.state == GLINT_MOVING && !cancel && !give(render, s, moments, moved)) {
      expect(is_short, "the scene of the first sample is refused for another one");
      glint_render_cancel(render);
      cancel = true;
    }
    cancel |= seconds_since(start) > kPatience;
    if (cancel && !by_another) glint_render_cancel(render);
    expect(seconds_since(start) < kLongest,
           "a small render takes a minute, although it was cancelled");
  } while (progress.state < GLINT_DONE);
  if (other.joinable()) other.join();
  expect(is_short || progress.state != GLINT_FAILED, glint_render_error(render));
  expect(progress.state != GLINT_FAILED ||
             std::strcmp(glint_render_error(render), "out of memory") == 0,
         glint_render_error(render));
  expect(cancel || is_short || progress.state == GLINT_DONE, "the render ended early");
  if (progress.state == GLINT_DONE && !is_short) check_pixels(render, s);
  glint_render_stats(render);
  return progress.state == GLINT_DONE;
}

/// One render of a scene; the first of its pictures goes to `kept`, which may outlive the scene.
void draw(Moments moments, const GlintRenderSettings& s, Dice& dice, Tally& tally, Kept& kept) {
  ErrorBuffer why(dice);
  GlintRender* render = glint_render_start(moments.first, &s, why.data(), why.size);
  if (!render) {
    ++tally.refused;
    return why.check();
  }
  if (dice.chance(0.9)) {
    run(render, s, moments, dice, kept);
    ++tally.renders;
  }
  glint_render_destroy(render);
}

/// Combined of a whole render without anything that disturbs it; empty where it is not to be had.
std::vector<float> picture_of(GlintScene* scene, const GlintRenderSettings& s, Dice& dice) {
  std::vector<float> values;
  GlintRender* render = glint_render_start(scene, &s, nullptr, 0);
  if (!render) return values;
  Kept none;
  Dice calm = dice;
  calm.wildness = 0;
  Moments still(scene);
  const bool done = run(render, s, still, calm, none);
  GlintPicture* picture =
      done ? glint_render_picture(render, GLINT_PASS_COMBINED, 4 * pixels_of(s)) : nullptr;
  if (picture)
    values.assign(glint_picture_values(picture), glint_picture_values(picture) + 4 * pixels_of(s));
  if (picture) glint_picture_free(picture);
  glint_render_destroy(render);
  return values;
}

/// A scene that takes over from `base`, and another one from that; those that are exact draw what a
/// scene of its own draws, to the bit.
void reuse_from(GlintScene* base, const GlintSceneData& before, Dice& dice, Arena& arena,
                Tally& tally) {
  const GlintSceneData data = varied(dice, arena, before);
  const bool exact = dice.chance(0.5);
  ErrorBuffer error(dice);
  GlintScene* handle = glint_scene_create_like(base, &data, exact, error.data(), error.size);
  if (!handle) {
    ++tally.refused;
    return error.check();
  }
  ++tally.taken_over;
  const GlintRenderSettings s = settings(dice, arena, data);
  if (GlintScene* own = exact ? glint_scene_create(&data, nullptr, 0) : nullptr) {
    const std::vector<float> one = picture_of(handle, s, dice), other = picture_of(own, s, dice);
    const bool both = !one.empty() && !other.empty();
    const bool same =
        !both || std::memcmp(one.data(), other.data(), one.size() * sizeof(float)) == 0;
    expect(same, "a scene that took over exactly draws other bits");
    glint_scene_destroy(own);
  } else {
    Kept kept;
    draw({handle, data, arena}, s, dice, tally, kept);
  }
  if (dice.chance(0.3)) reuse_from(handle, data, dice, arena, tally);
  glint_scene_destroy(handle);
}

}  // namespace

void try_render(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintSceneData data = scene(dice, arena);
  ErrorBuffer error(dice);
  GlintScene* handle =
      glint_scene_create(dice.chance(0.01) ? nullptr : &data, error.data(), error.size);
  if (!handle) {
    ++tally.refused;
    return error.check();
  }
  Kept kept[2];  // beyond the scene's own life
  for (size_t k = 1 + dice.below(2); k > 0; --k)
    draw({handle, data, arena}, settings(dice, arena, data), dice, tally, kept[k - 1]);
  if (dice.chance(0.3)) reuse_from(handle, data, dice, arena, tally);
  glint_scene_destroy(handle);
}

void try_shortage(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintSceneData data = scene(dice, arena);
  const GlintRenderSettings s = settings(dice, arena, data);
  Dice later = dice;
  char error[200] = "";
  GlintScene* handle;
  GlintRender* render = nullptr;
  {
    const bool of_threads = dice.chance(0.3);
    const size_t number = dice.below(of_threads ? 4 : dice.chance(0.5) ? 50 : 1000);
    const Shortage shortage(of_threads, number, dice.chance(0.5));
    {
      const Inside core;
      handle = glint_scene_create(&data, error, sizeof error);
      if (handle) render = glint_render_start(handle, &s, error, sizeof error);
    }
    Kept kept;
    if (render) {
      Moments still(handle);
      run(render, s, still, later, kept, true);
      ++tally.renders;
    }
    tally.short_of += shortage.refused();
  }
  expect(render || error[0], "refused without a text");
  glint_render_destroy(render);
  glint_scene_destroy(handle);
}

}  // namespace glint::fuzz
