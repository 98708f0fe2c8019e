// Layers on the way of rays, against the closest hits that follow each other.
#include <algorithm>
#include <cmath>

#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

/// Of all kinds of shapes, baked and instanced; triangles twice in one place, too.
struct Stack : MixedShapes {
  Random random{81};
  Mesh ball = icosphere(2, 0.8, {}), boxes = box_grid(4, 0.6, {}),
       clutter = soup(random, 3000, 1.5, 0.5);
  std::vector<uint8_t> kinds;

  explicit Stack(uint8_t kind) {
    for (const Mesh* mesh : {&ball, &boxes, &clutter}) add(*mesh);
    add_round_and_square(random, 50, 0.3);
    add_shapes();
    for (uint32_t g : {0u, 0u, 1u, 1u, 2u, 3u, 4u}) place(g, {});
    for (int k = 0; k < 20; ++k) place(uint32_t(k % 2), random_affine(random, 1));
    kinds.assign(instances.size(), kind);
  }
};

/// A third of the triangles lets all light through, and the others dim it; of kSolid a few.
template <bool Solid>
uint8_t by_number(const void*, uint32_t instance, uint32_t primitive, double, double) {
  const uint32_t number = primitive + instance;
  if (Solid && number % 50 == 7) return Opacity::kSolid;
  return number % 3 == 0 ? Opacity::kClear : Opacity::kVaried;
}

/// Tiles of rays to one point.
std::vector<Ray> rays_to_points(Random& random, double spread) {
  std::vector<Ray> rays;
  for (int block = 0; block < 8; ++block) {
    const Vec3d from = random.in_box(3), to = random.in_box(0.5);
    for (int k = 0; k < 64; ++k) {
      const Vec3d o = from + spread * random.in_box(1);
      rays.push_back(ray(o, to - o, 0, block % 3 ? HUGE_VAL : 1, kShadow));
    }
  }
  return rays;
}

struct Batch {
  std::vector<double> o[3], d[3], t_min, t_max;
  explicit Batch(const std::vector<Ray>& all) {
    for (const Ray& r : all) {
      for (int c = 0; c < 3; ++c) {
        o[c].push_back(r.o[c]);
        d[c].push_back(r.d[c]);
      }
      t_min.push_back(r.t_min);
      t_max.push_back(r.t_max);
    }
    for (auto* v : {&o[0], &o[1], &o[2], &d[0], &d[1], &d[2], &t_min, &t_max})
      v->resize(all.size() + 8);
  }
  Rays rays(size_t count, const Opacity& opacity) const {
    return {{o[0].data(), o[1].data(), o[2].data()},
            {d[0].data(), d[1].data(), d[2].data()},
            t_min.data(),
            t_max.data(),
            count,
            kShadow,
            &opacity};
  }
};

/// The layers of a ray from hit to hit, each sought from a little behind the last one.
std::vector<Hit> one_by_one(const Accel& accel, const Ray& r, const Opacity& opacity) {
  std::vector<Hit> layers;
  Scratch scratch;
  for (double t_min = r.t_min;;) {
    Batch batch({r});
    batch.t_min[0] = t_min;
    Hit hit;
    accel.closest(batch.rays(1, opacity), {&hit.t, &hit.instance, &hit.primitive, &hit.u, &hit.v},
                  scratch);
    if (hit.instance == Hit::kNone) return layers;
    layers.push_back(hit);
    t_min = hit.t + 0x1p-39 * hit.t;
  }
}

/// The same from what was found, where surfaces at one distance are there too.
std::vector<Hit> apart(const Hit* hits, uint32_t count, double t_min) {
  std::vector<Hit> layers;
  for (uint32_t k = 0; k < count; ++k)
    if (hits[k].t > t_min) {
      layers.push_back(hits[k]);
      t_min = hits[k].t + 0x1p-39 * hits[k].t;
    }
  return layers;
}

/// How many rays get other layers, and how many have more than fit.
int wrong_layers(const Accel& accel, const std::vector<Ray>& rays, const Opacity& opacity,
                 int& full) {
  std::vector<Hit> hits(rays.size() * Layers::kMost);
  std::vector<uint8_t> count(rays.size()), blocked(rays.size()), as_any(rays.size());
  const Batch batch(rays);
  Scratch scratch;
  accel.find_layers(batch.rays(rays.size(), opacity), {hits.data(), count.data()}, blocked.data(),
                    scratch);
  accel.occluded(batch.rays(rays.size(), opacity), as_any.data(), scratch);
  int wrong = 0;
  for (size_t k = 0; k < rays.size(); ++k) {
    wrong += blocked[k] != as_any[k];
    if (blocked[k] == 2) continue;
    const std::vector<Hit> all = one_by_one(accel, rays[k], opacity),
                           found =
                               apart(&hits[k * Layers::kMost],
                                     std::min<uint32_t>(count[k], Layers::kMost), rays[k].t_min);
    const bool more = count[k] > Layers::kMost;
    full += more;
    wrong += (more ? found.size() > all.size() : found.size() != all.size()) ||
             !std::equal(found.begin(), found.end(), all.begin(), same);
  }
  return wrong;
}

}  // namespace

TEST(layers, are_the_closest_hits_one_after_the_other) {
  const uint8_t all[] = {Opacity::kVaried, Opacity::kMapped};
  for (const uint8_t kind : all) {
    const Stack scene(kind);
    const Opacity opacity{scene.kinds.data(), nullptr, by_number<false>};
    for (const BuildQuality quality : kQualities) {
      const auto accel = build(scene.geometries, scene.instances, 2, quality);
      Random random(82);
      int full = 0;
      for (const double spread : {0.0, 0.01, 1.0})
        CHECK(wrong_layers(*accel, rays_to_points(random, spread), opacity, full) == 0);
      CHECK(full > 40);
    }
  }
}

TEST(layers, end_at_solid_surfaces) {
  const Stack scene(Opacity::kMapped);
  const Opacity opacity{scene.kinds.data(), nullptr, by_number<true>};
  const auto accel = build(scene.geometries, scene.instances);
  Random random(83);
  int full = 0;
  CHECK(wrong_layers(*accel, rays_to_points(random, 0.01), opacity, full) == 0);
}
