// The C functions of glint.h: catch everything, turn it into text.
#include <algorithm>
#include <memory>
#include <vector>

#include "api/guard.h"
#include "bvh/traverse/kernel.h"
#include "math/math.h"
#include "scene/scene.h"
#include "session/job.h"

static_assert(sizeof(void*) == 8, "the structures of glint.h are those of a 64-bit machine");

struct GlintScene {
  glint::Scene scene;
};

struct GlintRender {
  glint::Job job;
};

struct GlintPicture {
  std::shared_ptr<glint::ZeroedBuffer<float>> values;
};

namespace {

double evaluate(int32_t function, double x, double y) {
  switch (function) {
    case GLINT_EXP: return glint::exponential(x);
    case GLINT_LOG: return glint::logarithm(x);
    case GLINT_COS: return glint::cosine(x);
    case GLINT_SIN: return glint::sine(x);
    default: return glint::cosine_power(x, y);
  }
}

}  // namespace

uint32_t glint_abi_version(void) { return GLINT_ABI_VERSION; }
const char* glint_isa(void) { return glint::best_kernel().name; }

GlintScene* glint_scene_create(const GlintSceneData* data, char* error, size_t error_size) {
  return glint::guarded<GlintScene*>(nullptr, error, error_size, [&]() -> GlintScene* {
    std::string problems = data ? glint::scene_problems(*data) : "no scene";
    if (!problems.empty()) {
      glint::tell(error, error_size, problems.c_str());
      return nullptr;
    }
    return new GlintScene{glint::Scene(*data)};
  });
}

GlintScene* glint_scene_create_like(const GlintScene* base, const GlintSceneData* data,
                                    int32_t exact, char* error, size_t error_size) {
  return glint::guarded<GlintScene*>(nullptr, error, error_size, [&]() -> GlintScene* {
    std::string problems = base && data ? glint::scene_problems(*data, base->scene) : "no scene";
    if (!problems.empty()) {
      glint::tell(error, error_size, problems.c_str());
      return nullptr;
    }
    return new GlintScene{glint::Scene(*data, &base->scene, exact != 0)};
  });
}

void glint_scene_destroy(GlintScene* scene) { delete scene; }

GlintRender* glint_render_start(GlintScene* scene, const GlintRenderSettings* settings, char* error,
                                size_t error_size) {
  return glint::guarded<GlintRender*>(nullptr, error, error_size, [&]() -> GlintRender* {
    std::string problems = scene && settings ? glint::settings_problems(*settings, scene->scene)
                                             : "no scene or no settings";
    if (!problems.empty()) {
      glint::tell(error, error_size, problems.c_str());
      return nullptr;
    }
    return new GlintRender{{scene->scene, *settings}};
  });
}

GlintProgress glint_render_wait(GlintRender* render, uint32_t milliseconds) {
  return render->job.wait(milliseconds);
}
int32_t glint_render_move(GlintRender* render, GlintScene* scene,
                          const GlintRenderSettings* settings, char* error, size_t error_size) {
  return glint::guarded<int32_t>(-1, error, error_size, [&] {
    const std::string problems =
        scene && settings ? render->job.move(scene->scene, *settings) : "no scene or no settings";
    if (problems.empty()) return 0;
    glint::tell(error, error_size, problems.c_str());
    return -1;
  });
}
void glint_render_resume(GlintRender* render) { render->job.resume(); }
void glint_render_cancel(GlintRender* render) { render->job.cancel(); }
GlintPicture* glint_render_picture(GlintRender* render, int32_t pass, uint64_t size) {
  return glint::guarded<GlintPicture*>(nullptr, nullptr, 0, [&]() -> GlintPicture* {
    auto values = render->job.picture(pass, size);
    return values ? new GlintPicture{std::move(values)} : nullptr;
  });
}
float* glint_picture_values(GlintPicture* picture) { return picture->values->data(); }
void glint_picture_free(GlintPicture* picture) { delete picture; }
GlintStats glint_render_stats(GlintRender* render) { return render->job.stats(); }
const char* glint_render_error(GlintRender* render) { return render->job.error().c_str(); }
void glint_render_destroy(GlintRender* render) { delete render; }

void glint_math(int32_t function, const double* x, const double* y, double* out, uint64_t count) {
  for (uint64_t k = 0; k < count; ++k) out[k] = evaluate(function, x[k], y[k]);
}

int32_t glint_program_run(const int32_t* code, uint64_t words, const double* constants,
                          uint64_t constant_count, const double* tables, uint32_t slots,
                          double* columns, uint64_t count) {
  return glint::guarded<int32_t>(-1, nullptr, 0, [&] {
    const std::vector<double> spread = glint::spread_constants(constants, constant_count);
    const glint::ProgramShape program{code, words, spread.data(), tables, slots, false, false};
    const auto points = std::make_unique<glint::ProgramPoints>();
    std::vector<double> block(slots * glint::kBlock);
    for (uint64_t first = 0; first < count; first += glint::kBlock) {
      const size_t some = std::min<uint64_t>(count - first, glint::kBlock);
      for (uint32_t slot = 0; slot < slots; ++slot)
        std::copy_n(columns + slot * count + first, some, block.data() + slot * glint::kBlock);
      glint::best_stages().program(
          {{}, &program, points.get(), glint::RayKind::kCamera, some, block.data(), nullptr});
      for (uint32_t slot = 0; slot < slots; ++slot)
        std::copy_n(block.data() + slot * glint::kBlock, some, columns + slot * count + first);
    }
    return 0;
  });
}
