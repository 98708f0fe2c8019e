// Operations that read the shaded points.
#pragma once
#include "program/machine.h"

namespace glint {
namespace {
namespace op {

inline OnMesh on_mesh(const Machine& m, size_t k) {
  OnMesh p;
  for (size_t v = 0; v < 3; ++v) p.weights[v] = load(m.points.weights[v] + k);
  find_primitives(
      m.tables, [&](size_t lane) { return m.points.instance[k + lane]; },
      [&](size_t lane) { return m.points.primitive[k + lane]; }, p);
  return p;
}

inline void attribute(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const OnMesh p = on_mesh(m, k);
    if (at.wants(0)) at.put(0, k, read_color(m.tables, p, at.settings[0], GLINT_COLOR));
    if (at.wants(1)) at.put(1, k, read_color(m.tables, p, at.settings[0], GLINT_ALPHA).x);
  });
}

inline void uv(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Uvs uv = read_uv(m.tables, on_mesh(m, k), at.settings[0]);
    at.put(0, k, Three{uv.u, uv.v, Doubles{}});
  });
}

inline void image(const Machine& m, const Operands& at) {
  const TextureShape& t = m.tables.textures[at.settings[0]];
  each_group(m, [&](size_t k) {
    const Three uv = at.vector(0, k);
    if (at.wants(0)) at.put(0, k, sample<colors>(t, uv.x, uv.y));
    if (at.wants(1)) at.put(1, k, sample<alphas>(t, uv.x, uv.y));
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
