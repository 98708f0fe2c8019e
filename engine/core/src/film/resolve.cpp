#include "film/resolve.h"

#include <algorithm>
#include <cmath>

namespace glint {
namespace {

constexpr float kAlike = 0.9f;  // cosine between normals of which nothing is shared any more
constexpr float kFlat = 0.04f;  // the same of the way between points along one's normal, squared

using Floats = std::vector<float>;

/// Pixels of a window, row by row.
struct Span {
  size_t first, width, height, stride;
  size_t count() const { return width * height; }
  /// body(number in the span, pixel of the window) for the first pixel of each row.
  template <class Body>
  void rows(Body body) const {
    for (size_t y = 0; y < height; ++y) body(y * width, first + y * stride);
  }
  ptrdiff_t offset(int x, int y) const { return ptrdiff_t(y) * ptrdiff_t(stride) + x; }
};

/// The pixels but for `rim` at each end.
Span inside(const ResolveWindow& window, size_t rim) {
  return {rim * window.width + rim, window.width - 2 * rim, window.height - 2 * rim, window.width};
}

/// How surely the pixel `to` away from each of the span shows the same surface, 0 to 1.
void weigh(const ResolveWindow& window, const Span& span, ptrdiff_t to, float* weights) {
  const float* normal[3];
  const float* place[3];
  for (int c = 0; c < 3; ++c) {
    normal[c] = window.column(ResolveWindow::kNormal + c);
    place[c] = window.column(ResolveWindow::kPlace + c);
  }
  const float* const surface = window.column(ResolveWindow::kSurface);
  span.rows([&](size_t out, size_t at) {
    for (size_t i = 0; i < span.width; ++i) {
      const size_t p = at + i, q = size_t(ptrdiff_t(p) + to);
      float cosine = 0, along = 0, beside = 0, square = 0;
      for (int c = 0; c < 3; ++c) {
        const float d = place[c][q] - place[c][p];
        cosine += normal[c][p] * normal[c][q];
        along += d * normal[c][p];
        beside += d * normal[c][q];
        square += d * d;
      }
      const float alike = std::clamp((cosine - kAlike) * (1 / (1 - kAlike)), 0.0f, 1.0f),
                  off = std::max(along * along, beside * beside), most = kFlat * square,
                  flat = most > off   ? (most - off) / most
                         : square > 0 ? 0.0f
                                      : 1.0f;
      weights[out + i] = alike * flat * surface[p] * surface[q];
    }
  });
}

/// sum += weight value, the latter of the pixels `to` away.
void add(const Span& span, ptrdiff_t to, const float* weights, const float* values, float* sum) {
  span.rows([&](size_t out, size_t at) {
    const float* const from = values + (ptrdiff_t(at) + to);
    for (size_t i = 0; i < span.width; ++i) sum[out + i] += weights[out + i] * from[i];
  });
}

/// The weights of the pixels of a block round each of the span, one after the other.
struct Block {
  std::vector<ptrdiff_t> to;
  Floats weights;
  Block(const Span& span, int reach) {
    for (int j = -reach; j <= reach; ++j)
      for (int i = -reach; i <= reach; ++i) {
        to.push_back(span.offset(i, j));
        const float share =
            (std::abs(i) == reach ? 0.5f : 1.0f) * (std::abs(j) == reach ? 0.5f : 1.0f);
        weights.insert(weights.end(), span.count(), share);
      }
  }
  const float* of(size_t k) const { return weights.data() + k * (weights.size() / to.size()); }
};

/// How far each pixel of the span is from the mean of those a block to either side of it, squared,
/// on the axis on which it is farther.
class Changes {
 public:
  Changes(const ResolveWindow& window, const Span& span, int side)
      : span_(span), pixels_(window.pixels()) {
    for (size_t axis = 0; axis < 2; ++axis) {
      to_[axis] = axis == 0 ? span.offset(side, 0) : span.offset(0, side);
      for (size_t k = 0; k < 2; ++k) {
        same_[axis][k].resize(span.count());
        weigh(window, span, k == 0 ? to_[axis] : -to_[axis], same_[axis][k].data());
      }
    }
  }

  void of(const float* values, Floats& found) const {
    found.assign(pixels_, 0.0f);
    for (size_t axis = 0; axis < 2; ++axis) {
      const float *const after = same_[axis][0].data(), *const before = same_[axis][1].data();
      span_.rows([&](size_t out, size_t at) {
        const float* const here = values + at;
        const float* const next = here + to_[axis];
        const float* const last = here - to_[axis];
        for (size_t i = 0; i < span_.width; ++i) {
          const float a = after[out + i], b = before[out + i], sum = a + b,
                      mean = (a * next[i] + b * last[i]) / (sum > 0 ? sum : 1),
                      off = sum > 0 ? here[i] - mean : 0;
          found[at + i] = std::max(found[at + i], off * off);
        }
      });
    }
  }

 private:
  Span span_;
  size_t pixels_;
  ptrdiff_t to_[2] = {};
  Floats same_[2][2];
};

int color_of(int light) {
  return ResolveWindow::kColor + (light < kVolumeDirect ? 3 * (light / 2) : 9);
}

/// Of the region, the pixel of that number of the span.
uint32_t pixel_of(const Span& span, size_t number, uint32_t x0, uint32_t y0, uint32_t width) {
  return (y0 + uint32_t(number / span.width)) * width + x0 + uint32_t(number % span.width);
}

float over(float a, float b) { return b > 0 ? a / b : 0; }

}  // namespace

Resolve::Resolve(uint32_t side, Region region, bool keeps_lights)
    : side_(side), width_(region.width()) {
  const size_t pixels = size_t(region.width()) * region.height();
  added_ = ZeroedBuffer<float>(3 * pixels);
  if (keeps_lights) lights_ = ZeroedBuffer<float>(3 * kResolvedLights * pixels);
}

void Resolve::run(const ResolveWindow& window, uint32_t x0, uint32_t y0, bool is_halved) {
  const int half = int(side_ / 2);
  const Span own = inside(window, looks_at());
  const Block in_media(own, half);
  Block on_surfaces = in_media;
  Floats same(own.count());
  for (size_t k = 0; k < on_surfaces.to.size(); ++k) {
    weigh(window, own, on_surfaces.to[k], same.data());
    for (size_t i = 0; i < own.count(); ++i) on_surfaces.weights[k * own.count() + i] *= same[i];
  }
  const Changes changes(window, inside(window, side_), int(side_));
  Floats white(window.pixels()), tint(window.pixels()), change, light_sum[3], color_sum[3], apart,
      changed, noise, none(window.pixels());
  for (size_t y = 0; y < own.height; ++y)
    std::fill_n(added_.data() + 3 * ((y0 + y) * width_ + x0), 3 * own.width, 0.0f);
  for (int light = 0; light < kResolvedLights; ++light) {
    const Block& block = light < kVolumeDirect ? on_surfaces : in_media;
    const float *values[3], *colors[3];
    for (int c = 0; c < 3; ++c) {
      values[c] = window.column(ResolveWindow::kLight + 3 * light + c);
      colors[c] = window.column(color_of(light) + c);
    }
    bool any = false;
    for (size_t i = 0; i < window.pixels(); ++i) {
      const float all = values[0][i] + values[1][i] + values[2][i];
      tint[i] = colors[0][i] + colors[1][i] + colors[2][i];
      white[i] = over(all, tint[i]);
      any |= all != 0;
    }
    float* const lights = lights_.size() ? lights_.data() : nullptr;
    for (size_t k = 0; lights && !any && k < own.count(); ++k)
      std::fill_n(lights + place(light, pixel_of(own, k, x0, y0, width_)), 3, 0.0f);
    if (!any) continue;
    changes.of(white.data(), change);
    for (int c = 0; c < 3; ++c) {
      light_sum[c].assign(own.count(), 0.0f);
      color_sum[c].assign(own.count(), 0.0f);
    }
    for (size_t k = 0; k < block.to.size(); ++k)
      for (int c = 0; c < 3; ++c) {
        add(own, block.to[k], block.of(k), values[c], light_sum[c].data());
        add(own, block.to[k], block.of(k), colors[c], color_sum[c].data());
      }
    Floats mean(own.count());
    for (size_t i = 0; i < own.count(); ++i)
      mean[i] = over(light_sum[0][i] + light_sum[1][i] + light_sum[2][i],
                     color_sum[0][i] + color_sum[1][i] + color_sum[2][i]);
    apart.assign(own.count(), 0.0f);
    changed.assign(own.count(), 0.0f);
    noise.assign(own.count(), 0.0f);
    const bool is_image = light >= kGlossyDirect && light < kVolumeDirect,
               halved = !is_image && is_halved;
    const int number = light >= kVolumeDirect ? 2 + light - kVolumeDirect : light;
    const float* const halves =
        halved ? window.column(ResolveWindow::kNoise + number) : none.data();
    for (size_t k = 0; k < block.to.size(); ++k) {
      const float* const weights = block.of(k);
      own.rows([&](size_t out, size_t at) {
        const size_t first = size_t(ptrdiff_t(at) + block.to[k]);
        for (size_t i = 0; i < own.width; ++i) {
          const size_t q = first + i;
          const float off = white[q] - mean[out + i], weight = weights[out + i] * tint[q] * tint[q];
          apart[out + i] += weight * off * off;
          changed[out + i] += weight * change[q];
          noise[out + i] += weight * halves[q] * halves[q];
        }
      });
    }
    own.rows([&](size_t out, size_t at) {
      for (size_t i = 0; i < own.width; ++i) {
        const size_t k = out + i, q = at + i, pixel = pixel_of(own, k, x0, y0, width_);
        const float stays = halved ? std::max(apart[k] - noise[k], 0.0f) : changed[k],
                    repeats = apart[k] > stays ? 1 - stays / apart[k] : 0;
        for (int c = 0; c < 3; ++c) {
          const float resolved = over(light_sum[c][k], color_sum[c][k]) * colors[c][q],
                      given = color_sum[c][k] > 0 ? repeats * (resolved - values[c][q]) : 0;
          added_.data()[3 * pixel + size_t(c)] += given;
          if (lights) lights[place(light, uint32_t(pixel)) + size_t(c)] = given;
        }
      }
    });
  }
}

}  // namespace glint
