// What surfaces let through of shadow rays (semantics/shadows.md).
#pragma once
#include <algorithm>

#include "program/run.h"
#include "shading/stage_inputs.h"
#include "shading/stage_rows.h"
#include "shading/stage_surface.h"

namespace glint {
namespace {

/// Hits of a group of rays; lanes beyond their end repeat the first.
struct Met {
  uint32_t instance[kLanes], primitive[kLanes];
  bool together;  // on one triangle
  Met(const TransmittanceStage& s, size_t k, size_t count) {
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const size_t row = lane < count ? k + lane : k;
      instance[lane] = s.instance[row];
      primitive[lane] = s.primitive[row];
    }
    together = same(instance) && same(primitive);
  }
};

inline const GroupShape& group_of(const TransmittanceStage& s, uint32_t instance) {
  return s.shapes[s.tables.instances[instance].group];
}

/// Their triangles; points for hits on other things.
inline Spread triangles(const TransmittanceStage& s, const Met& at) {
  Gathered all{};
  for (size_t lane = 0; lane < (at.together ? 1 : kLanes); ++lane) {
    const GroupShape& group = group_of(s, at.instance[lane]);
    all.instance[lane] = s.tables.instances + at.instance[lane];
    all.same_instance = all.same_instance && all.instance[lane] == all.instance[0];
    if (group.triangles)
      gather_rows(group.vertices, group.triangles + 3 * size_t(at.primitive[lane]), lane,
                  all.corners);
  }
  if (at.together) {
    const auto vertex = [&](size_t v) {
      return Three{splat(all.corners[3 * v][0]), splat(all.corners[3 * v + 1][0]),
                   splat(all.corners[3 * v + 2][0])};
    };
    return Spread(Matrices(*all.instance[0]), {vertex(0), vertex(1), vertex(2)});
  }
  if (!all.same_instance) spread_matrices(all);
  return Spread(all.same_instance ? Matrices(*all.instance[0]) : Matrices(all),
                {rows3(all.corners), rows3(all.corners + 3), rows3(all.corners + 6)});
}

inline bool follow_each_other(const uint32_t (&row)[kLanes]) {
  bool all = true;
  for (uint32_t lane = 1; lane < kLanes; ++lane) all = all && row[lane] == row[0] + lane;
  return all;
}

/// The rays of hits from row k on. A ray may be there several times.
inline Chosen rays_of(const TransmittanceStage& s, size_t k, size_t end) {
  Chosen ray = chosen(s.number, k, end);
  ray.together = follow_each_other(ray.row);
  return ray;
}

/// The rays from the points that they left: not moved off the surface, as those that are traced.
struct Leaving {
  Three origin, d;
  Leaving(const TransmittanceStage& s, const Chosen& ray) {
    Chosen from = ray;
    for (size_t lane = 0; lane < kLanes; ++lane) from.row[lane] = s.point[ray.row[lane]];
    from.together = follow_each_other(from.row);
    origin = s.start[0] ? gather3(s.start, ray) : gather3(s.origin, from);
    d = s.end[0] ? unit(gather3(s.end, ray) - origin) : gather3(s.to, ray);
  }
};

/// Where on their meshes they are, seen from the points that the rays left.
inline OnMesh on_mesh(const TransmittanceStage& s, size_t k, const Chosen& ray, const Met& at) {
  const Leaving from(s, ray);
  const Weights b =
      solve_weights(from.origin, from.d, triangles(s, at), widen(s.u + k), widen(s.v + k));
  OnMesh p;
  p.weights[0] = b.a;
  p.weights[1] = b.b;
  p.weights[2] = b.c;
  find_primitives(
      s.tables, [&](size_t lane) { return at.instance[lane]; },
      [&](size_t lane) { return at.primitive[lane]; }, p);
  return p;
}

inline bool constant(const TransmittanceStage& s) {
  bool constant = true;
  for (uint32_t i = 0; i < s.lobe_count; ++i)
    constant = constant && (s.lobes[i].kind != GLINT_TRANSPARENT || s.lobes[i].constant);
  return constant;
}

/// The sum of the TRANSPARENT lobes.
inline Three transparency(const TransmittanceStage& s, const OnMesh& p) {
  Three sum{};
  Reads reads;
  for (uint32_t i = 0; i < s.lobe_count; ++i)
    if (s.lobes[i].kind == GLINT_TRANSPARENT)
      sum = sum + coefficient(s.tables, p, s.lobes[i], reads);
  return sum;
}

/// How much narrower light from beyond the surface comes than it does there, by the lobes that let
/// it through: as much less is it where no other surface makes it wide again.
inline Doubles narrowed(const TransmittanceStage& s, const OnMesh& p, Mask outside) {
  Doubles sum{}, narrow{};
  Reads reads;
  for (uint32_t i = 0; i < s.lobe_count; ++i) {
    if (s.lobes[i].kind != GLINT_TRANSPARENT) continue;
    const Three k = coefficient(s.tables, p, s.lobes[i], reads);
    const Doubles ior = lobe_ior(p, s.lobes[i]), size = larger(k.x + k.y + k.z, splat(0)),
                  square = ior * ior;
    sum = sum + size;
    narrow = narrow + size * choose(outside, square, 1 / square);
  }
  return choose(sum > 0, narrow / choose(sum > 0, sum, splat(1)), splat(1));
}

inline Doubles clamped_share(Doubles x) { return larger(smaller(x, splat(1)), splat(0)); }

/// What the surface stage needs of a block of hits beside what programs read.
struct BlockScratch {
  double start[3][kBlock], origin[3][kBlock], offset[kBlock];
  uint32_t material[kBlock];
};

/// The surface stage over a block of hits whose rays are there already, to what programs read.
inline void place_block(const TransmittanceStage& s, size_t k, size_t count, BlockScratch& scratch,
                        ProgramPoints& p) {
  SurfaceStage at{};
  at.count = count;
  at.instance = p.instance;
  at.primitive = p.primitive;
  at.u = s.u + k;
  at.v = s.v + k;
  at.instances = s.tables.instances;
  at.groups = s.shapes;
  for (size_t c = 0; c < 3; ++c) {
    at.start[c] = scratch.start[c];
    at.d[c] = p.d[c];
    at.x[c] = p.x[c];
    at.g[c] = p.g[c];
    at.n[c] = p.n[c];
    at.origin[c] = scratch.origin[c];
  }
  at.offset = scratch.offset;
  at.weights[0] = p.weights[1];
  at.weights[1] = p.weights[2];
  at.outside = p.outside;
  at.material = scratch.material;
  surface(at);
}

/// A hit on what is no mesh.
inline void set_solid(const double* solid, size_t i, ProgramPoints& p) {
  for (size_t c = 0; c < 3; ++c) {
    p.x[c][i] = solid[c];
    p.g[c][i] = p.n[c][i] = solid[3 + c];
  }
  p.outside[i] = solid[6] != 0 ? -1 : 0;
  p.weights[1][i] = solid[7];
  p.weights[2][i] = 0;
}

/// What bends rays at the hits of a block: whether their outer sides are seen, the face's normal
/// (smooth ones of a pane would make it a lens), and the ray's direction.
struct Bends {
  int64_t outside[kBlock];
  double g[3][kBlock], d[3][kBlock];
};

/// By how much the optical momentum of light that goes straight on changes: along the normal alone,
/// so that what enters by one side of a pane and leaves by the other adds up to nothing.
inline Three bent(const Bends& at, size_t k, Doubles narrowed) {
  const Mask outside = load(at.outside + k);
  const Three g = op::point3(at.g, k), d = op::point3(at.d, k);
  const Doubles cosine = -dot(g, d), square = choose(outside, narrowed, 1 / narrowed);
  const Doubles size = root(larger(square - 1 + cosine * cosine, splat(0))) - cosine;
  return choose(outside, -size, size) * g;
}

/// The program at the hits of a block, from k on, and what bends rays there.
void run_block(const TransmittanceStage& s, size_t k, size_t count, Bends& bends) {
  ProgramPoints p;
  BlockScratch scratch;
  for (size_t i = 0; i < count; i += kLanes) {
    const Chosen ray = rays_of(s, k + i, k + count);
    const Met at(s, k + i, ray.count);
    const Leaving from(s, ray);
    put3(scratch.start, i, from.origin);
    put3(p.d, i, from.d);
    for (size_t lane = 0; lane < kLanes; ++lane) {
      p.instance[i + lane] = at.instance[lane];
      p.primitive[i + lane] = at.primitive[lane];
    }
    store(p.weights[1] + i, Doubles{});
    store(p.weights[2] + i, Doubles{});
  }
  place_block(s, k, count, scratch, p);
  for (size_t i = 0; s.solids && i < count; ++i)
    if (scratch.material[i] == kNoMaterial) set_solid(s.solids + 8 * (k + i), i, p);
  std::copy_n(p.outside, kBlock, bends.outside);
  for (size_t c = 0; c < 3; ++c) {
    std::copy_n(p.g[c], kBlock, bends.g[c]);
    std::copy_n(p.d[c], kBlock, bends.d[c]);
  }
  if (!s.program) return;
  for (size_t i = 0; s.program->reads_ray && i < count; i += kLanes) {
    const Three way = op::point3(p.x, i) - op::point3(scratch.start, i);
    store(p.length + i, length(way) / s.tables.view->scale);
    store(p.tags + i, Mask{} + (int64_t(1) << RayTag::kDepth));
  }
  for (size_t i = 0; i < count; i += kLanes)
    store(p.weights[0] + i, 1 - load(p.weights[1] + i) - load(p.weights[2] + i));
  run_program({s.tables, s.program, &p, s.kind, count, s.slots, nullptr});
}

void transmit(const TransmittanceStage& s) {
  const bool alike = constant(s);
  Bends bends;
  for (size_t k = s.first, end = s.first + s.count; k < end; k += kLanes) {
    const Chosen ray = rays_of(s, k, end);
    const size_t in_block = (k - s.first) % kBlock;
    if ((s.program || s.narrowed) && in_block == 0)
      run_block(s, k, end - k < kBlock ? end - k : kBlock, bends);
    OnMesh p{};
    if (!alike) p = on_mesh(s, k, ray, Met(s, k, ray.count));
    if (s.program) p.slots = s.slots + in_block;
    const Three share = transparency(s, p);
    store(s.share[0] + k, clamped_share(share.x));
    store(s.share[1] + k, clamped_share(share.y));
    store(s.share[2] + k, clamped_share(share.z));
    if (!s.narrowed) continue;
    const Doubles narrow = narrowed(s, p, load(bends.outside + in_block));
    store(s.narrowed + k, narrow);
    const Three b = bent(bends, in_block, narrow);
    store(s.bent[0] + k, b.x);
    store(s.bent[1] + k, b.y);
    store(s.bent[2] + k, b.z);
  }
}

}  // namespace
}  // namespace glint
