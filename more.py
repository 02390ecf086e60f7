from bench_physics import *
from dataclasses import replace
from rverror.geartrain.mechanism import ContactLaw
for law in (ContactLaw(),ContactLaw(pin_exponent=10/9,flank_exponent=10/9)):
  unit=rverror.reducer("RV-40E",contact_law=law); other=replace(unit,stiffness=rverror.Stiffness(pin_contact=2.2e5,crank_bearing=2.7e5))
  for n in (512,2048):
    th=np.arange(n)*2*np.pi/n; p=Predictor(unit,Conditions(th,np.ones(n),20e3)); m=model(unit); near=p.predict(m); mo=rverror.Model(other,m.effects)
    print(n,"other stiffness, shared %.1f ms"%best(lambda:p.elastic(other).predict(mo,near)),"anew %.1f ms"%best(lambda:Predictor(other,p.conditions).predict(mo,near),3))
    for key,idx,v in (("cycloid.pin_compliance_wave",dict(harmonic=2),{"cos":1e-6}),("crank.bearing_compliance",dict(crank=0,disc=0),{"compliance":1e-6})):
      ms=rverror.Model(unit,(*m.effects,rverror.effect(key,**idx,**v)))
      print("  with",key,"near %.1f ms"%best(lambda:p.predict(ms,near)))
