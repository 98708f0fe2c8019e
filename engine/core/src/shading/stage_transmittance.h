// What surfaces let through of shadow rays (SEMANTICS.md, shadows). Letters: S what is left of the
// light, a channel.
#pragma once
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
      instance[lane] = s.instance[row], primitive[lane] = s.primitive[row];
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

/// The rays from the points that they left: not moved off the surface, as those that are traced.
struct Leaving {
  Three origin, d;
  Leaving(const TransmittanceStage& s, const Chosen& ray) {
    Chosen from = ray;
    for (size_t lane = 0; lane < kLanes; ++lane) from.row[lane] = s.point[ray.row[lane]];
    from.together = from.row[kLanes - 1] - from.row[0] == kLanes - 1;
    origin = gather3(s.origin, from);
    d = s.end[0] ? unit(gather3(s.end, ray) - origin) : gather3(s.to, ray);
  }
};

/// Where on their meshes they are, seen from the points that the rays left.
inline OnMesh on_mesh(const TransmittanceStage& s, size_t k, const Chosen& ray, const Met& at) {
  const Leaving from(s, ray);
  const Weights b =
      solve_weights(from.origin, from.d, triangles(s, at), load(s.u + k), load(s.v + k));
  OnMesh p;
  p.weights[0] = b.a, p.weights[1] = b.b, p.weights[2] = b.c;
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

inline Doubles clamped_share(Doubles x) { return larger(smaller(x, splat(1)), splat(0)); }

/// Rays with light left move to the front, past their surfaces.
inline void keep(const TransmittanceStage& s, size_t k, const Chosen& ray, uint32_t lanes,
                 size_t kept) {
  const Appender append{lanes, kept};
  for (size_t c = 0; c < TransmittedRay::kTMin; ++c)
    append(s.rays + c * s.stride, load(s.rays + c * s.stride + k));
  const Doubles t = load(s.rays + TransmittedRay::kT * s.stride + k),
                t_max = load(s.rays + TransmittedRay::kTMax * s.stride + k);
  append(s.rays + TransmittedRay::kTMin * s.stride, beyond(t)),
      append(s.rays + TransmittedRay::kTMax * s.stride, t_max);
  for (uint32_t m = lanes; m; m &= m - 1) s.number[kept++] = ray.row[__builtin_ctz(m)];
}

/// What the surface stage needs of a block of hits beside what programs read.
struct BlockScratch {
  double start[3][kBlock], origin[3][kBlock], offset[kBlock];
  uint32_t material[kBlock];
};

/// The program at the hits of a block of rays, from k on.
void run_block(const TransmittanceStage& s, size_t k, size_t count) {
  ProgramPoints p;
  BlockScratch scratch;
  for (size_t i = 0; i < count; i += kLanes) {
    const Chosen ray = chosen(s.number, k + i, k + count);
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
    at.points.x[c] = p.x[c];
    at.points.g[c] = p.g[c];
    at.points.n[c] = p.n[c];
    at.points.origin[c] = scratch.origin[c];
  }
  at.points.offset = scratch.offset;
  at.points.weights[0] = p.weights[1];
  at.points.weights[1] = p.weights[2];
  at.points.outside = p.outside;
  at.points.material = scratch.material;
  surface(at);
  for (size_t i = 0; s.solids && i < count; ++i) {
    if (scratch.material[i] != kNoMaterial) continue;
    const double* shape = s.solids + k + i;
    for (size_t c = 0; c < 3; ++c) {
      p.x[c][i] = shape[c * s.stride];
      p.g[c][i] = shape[(3 + c) * s.stride];
      p.n[c][i] = p.g[c][i];
    }
    p.outside[i] = shape[6 * s.stride] != 0 ? -1 : 0;
    p.weights[1][i] = p.weights[2][i] = 0;
  }
  for (size_t i = 0; i < count; i += kLanes)
    store(p.weights[0] + i, 1 - load(p.weights[1] + i) - load(p.weights[2] + i));
  run_program({s.tables, s.program, &p, RayKind::kShadow, count, s.slots});
}

size_t transmit(const TransmittanceStage& s) {
  const bool alike = constant(s);
  const size_t end = s.first + s.count;
  size_t kept = s.kept;
  for (size_t k = s.first; k < end; k += kLanes) {
    const Chosen ray = chosen(s.number, k, end);
    OnMesh p{};
    if (s.program && (k - s.first) % kBlock == 0)
      run_block(s, k, end - k < kBlock ? end - k : kBlock);
    if (!alike) p = on_mesh(s, k, ray, Met(s, k, ray.count));
    if (s.program) p.slots = s.slots + (k - s.first) % kBlock;
    const Three share = transparency(s, p);
    const Three S = gather3(s.shadow, ray) *
                    Three{clamped_share(share.x), clamped_share(share.y), clamped_share(share.z)};
    scatter3(s.shadow, ray, S);
    const uint32_t lanes = bits(nonzero(S)) & lanes_of(ray);
    keep(s, k, ray, lanes, kept);
    kept += size_t(__builtin_popcount(lanes));
  }
  return kept;
}

}  // namespace
}  // namespace glint
