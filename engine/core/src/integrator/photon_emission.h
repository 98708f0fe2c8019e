// From where photons leave lamps, towards what is specular.
#pragma once
#include <cstdint>
#include <vector>

#include "integrator/plan.h"
#include "scene/scene.h"

namespace glint {

/// What mirrors or refracts sharply: some placements, in a ball.
struct Caster {
  uint32_t first = 0, last = 0;  // of the placements
  Vec3d center;
  double radius = 0;
};

/// A photon on its way from a lamp. share: of the power of its beam's photons. at: on the lamp;
/// nothing of what is endless.
struct EmittedPhoton {
  Vec3d o, d, at;
  double share = 0;
};

/// The photons that one of some places on a lamp sends towards a caster: from one place they stay
/// as even as they were sent, wherever mirrors and lenses bring them.
struct PhotonBeam {
  const Light* light;
  const Caster* caster;
  uint32_t place, places;
  uint32_t count = 0;

  /// Whether its photons may leave: the lamp shines there.
  bool shines() const;
  /// Of the i-th photon: its flux over pi is that share of the lamp's colour.
  EmittedPhoton photon(uint32_t i) const;
  /// About how much light goes to the caster.
  double power() const;
  /// A number of [0, 1) by which the i-th photon is mirrored or refracted.
  double choice(uint32_t i) const;
};

/// What there is in the scene of sharp mirrors and glass.
std::vector<Caster> find_casters(const Scene& scene, const RenderPlan& plan);

/// All photons of a picture, beam by beam. casters: to live as long as the beams.
std::vector<PhotonBeam> find_beams(const Scene& scene, const RenderPlan& plan,
                                   const std::vector<Caster>& casters);

/// Whether photons bring the light of this lamp that mirrors throw.
bool throws_photons(const Light& light);

}  // namespace glint
