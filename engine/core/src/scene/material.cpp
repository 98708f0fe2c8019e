#include "scene/material.h"

#include <algorithm>
#include <memory>

#include "scene/scene.h"

namespace glint {
namespace {

Vec3d finite_or_zero(Vec3d c) {
  return {std::isfinite(c.x) ? c.x : 0, std::isfinite(c.y) ? c.y : 0, std::isfinite(c.z) ? c.z : 0};
}

Vec3d channel_of(const Rgba& c, int channel) {
  if (channel == GLINT_ALPHA) return {c.alpha, c.alpha, c.alpha};
  double grey = mean(c.color);
  return channel == GLINT_LUMINANCE ? Vec3d{grey, grey, grey} : c.color;
}

Rgba read_image(const Scene& scene, const GlintInput& input, const Surface& s) {
  Uv uv = uv_at(scene, s, input.uv);
  const double* m = input.uv_transform;
  double u = m[0] * uv.u + m[1] * uv.v + m[2], v = m[3] * uv.u + m[4] * uv.v + m[5];
  return scene.textures[size_t(input.texture)].lookup(u, v);
}

Rgba image_at(const Scene& scene, uint32_t i, const Surface& s, PointReads& reads) {
  const uint32_t number = scene.reads[i];
  for (uint32_t k = 0; k < reads.count; ++k)
    if (reads.number[k] == number) return reads.color[k];
  const Rgba color = read_image(scene, scene.inputs[i], s);
  if (reads.count < PointReads::kKept) {
    reads.color[reads.count] = color;
    reads.number[reads.count++] = number;
  }
  return color;
}

Vec3d bounded(Vec3d a, const GlintInput& input) {
  const auto channel = [&](double x, double offset) {
    return std::clamp(x + offset, input.low, input.high);
  };
  return {channel(a.x, input.offset[0]), channel(a.y, input.offset[1]),
          channel(a.z, input.offset[2])};
}

Vec3d evaluate(const Scene& scene, uint32_t i, const Surface& s, PointReads& reads) {
  const GlintInput& input = scene.inputs[i];
  Vec3d product{input.value[0], input.value[1], input.value[2]};
  if (input.texture >= 0)
    product = product * channel_of(image_at(scene, i, s, reads), input.channel);
  if (input.attribute >= 0)
    product = product * channel_of(color_at(scene, s, input.attribute), input.attribute_channel);
  if (input.output > 0) {
    const double* slot = reads.slots + size_t(input.output - 1) * kBlock;
    product = product * Vec3d{slot[0], slot[kBlock], slot[2 * kBlock]};
  }
  return of_product(input, finite_or_zero(product));
}

/// The slots of a material's program at one point, kBlock apart.
std::vector<double> run_at(const Scene& scene, const Material& material, const Surface& s,
                           const MeetingRay& ray) {
  const ProgramShape& program = scene.program_of(material);
  const auto points = std::make_unique<ProgramPoints>();
  for (size_t k = 0; k < kPad; ++k) {
    points->instance[k] = s.instance;
    points->primitive[k] = s.primitive;
    points->outside[k] = s.outside ? -1 : 0;
    for (int c = 0; c < 3; ++c) {
      points->weights[c][k] = s.weights[c];
      points->x[c][k] = s.x[c];
      points->g[c][k] = s.g[c];
      points->n[c][k] = s.n[c];
      points->d[c][k] = ray.d[c];
    }
    points->length[k] = length(s.x - ray.start) / scene.anchor.scale;
    points->tags[k] = ray.tag;
  }
  std::vector<double> slots(program.slots * kBlock);
  best_stages().program(
      {scene.input_tables(), &program, points.get(), ray.kind, 1, slots.data(), nullptr});
  return slots;
}

}  // namespace

Vec3d of_product(const GlintInput& input, Vec3d product) {
  if (input.bounded) product = bounded(product, input);
  return input.complement ? Vec3d{1, 1, 1} - product : product;
}

Vec3d coefficient(const Scene& scene, const Lobe& lobe, const Surface& s, PointReads& reads) {
  if (lobe.constant) return lobe.k;
  Vec3d k{1, 1, 1};
  for (uint32_t i = 0; i < lobe.input_count; ++i)
    k = k * evaluate(scene, lobe.first_input + i, s, reads);
  return finite_or_zero(k);
}

Vec3d transparency(const Scene& scene, const Material& material, const Surface& s,
                   const MeetingRay& ray) {
  Vec3d sum;
  PointReads reads;
  if (!material.has(GLINT_TRANSPARENT)) return sum;
  std::vector<double> slots;
  if (material.program > 0) {
    slots = run_at(scene, material, s, ray);
    reads.slots = slots.data();
  }
  for (uint32_t i = 0; i < material.lobe_count; ++i) {
    const Lobe& lobe = scene.lobes[material.first_lobe + i];
    if (lobe.kind == GLINT_TRANSPARENT) sum += coefficient(scene, lobe, s, reads);
  }
  return sum;
}

}  // namespace glint
