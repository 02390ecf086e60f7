import time, numpy as np, rverror
from rverror.statics.prediction import Predictor
from rverror.geartrain.kinematics import Conditions
from rverror.model.effects import Effect, Model
import sys
def model(unit):
    E=lambda k,v,**i: rverror.effect(k, **i, **v)
    return rverror.Model(unit, (
     E("cycloid.pin_position",{"radial":4e-3,"tangential":2e-3},pin=5),
     E("cycloid.disc_pitch",{"cos":3e-3,"sin":-2e-3},disc=0,harmonic=1),
     E("crank.eccentricity",{"radial":4e-3,"tangential":2e-3},crank=0,disc=1),
     E("involute.sun_eccentricity",{"x":5e-3,"y":2e-3}),
     E("involute.planet_eccentricity",{"x":5e-3,"y":2e-3},crank=1),
     E("cycloid.disc_bore_position",{"radial":2e-3,"tangential":2e-3},disc=0,crank=1),
     E("coupling.carrier_bore_position",{"radial":2e-3,"tangential":2e-3},crank=1)))
def best(f,k=7):
    t=[]
    for _ in range(k):
        a=time.perf_counter(); f(); t.append(time.perf_counter()-a)
    return min(t)*1e3
if __name__=="__main__":
    units={"linear":rverror.reducer("RV-40E")}
    if hasattr(rverror,"ContactLaw") :
        from rverror.geartrain.mechanism import ContactLaw
        units["10/9"]=rverror.reducer("RV-40E",contact_law=ContactLaw(pin_exponent=10/9,flank_exponent=10/9))
        units["pin only"]=rverror.reducer("RV-40E",contact_law=ContactLaw(pin_exponent=10/9))
    for name,unit in units.items():
      for torque in (20e3,412e3):
        for n in (512,2048):
            th=np.arange(n)*2*np.pi/n
            p=Predictor(unit,Conditions(th,np.ones(n),torque))
            m=model(unit)
            near=p.predict(m)
            import dataclasses
            m2=rverror.Model(unit,tuple(dataclasses.replace(e,values=tuple(1.1*v for v in e.values)) for e in m.effects))
            print(name,torque,n,"cold %.1f ms"%best(lambda:p.predict(m),3),"near %.1f ms"%best(lambda:p.predict(m2,near)))
