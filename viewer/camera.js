// viser's player takes its camera from the address of the page; files differ from their addresses only after a "?".
if (innerWidth < innerHeight) {
  const aspect = innerWidth / innerHeight, place = CENTRE.map((x, i) => x + ALONG[i] * NEAREST / aspect);
  history.replaceState(null, "", `?initialCameraPosition=${place}&initialCameraLookAt=${CENTRE}` + location.hash);
}
