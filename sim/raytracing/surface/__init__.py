"""How surfaces reflect: Fresnel coefficients, scattering lobes, texture, speckle."""
